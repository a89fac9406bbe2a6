"""The settings that vary among runs, each by the name that a user would type, with its values.

    variance, size, noise    of the sources' distribution; where targets are shifted, theirs are target.variance
    family, distribution     its family, and all of it by its label
    sources.tasks, sources.learner, estimator, library    how the sources were learned and fitted
    epsilon, alpha, gamma, explore, temperature, learner, episodes, tasks    how the targets are learned
    method, ptrs.psi         the method with what it starts from, and its options

Which sources were drawn, and which targets (`seed`), are what intervals are over: neither is a setting here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from qinit_cli.artefacts.settings import StoredFamily, plain_learning
from qinit_cli.comparison.setting_text import setting_text
from qinit_cli.errors import UsageError
from qinit_cli.learning import EXACT, IMPORTED
from qinit_cli.nearest import nearest

if TYPE_CHECKING:
    from qinit_cli.comparison.runs import ComparedRun

Value = float | int | str | bool
Known = dict[str, Value]  # settings of a run by name
Where = tuple[tuple[str, Value], ...]  # some settings by name, with the value of each

METHOD, DISTRIBUTION, FAMILY = "method", "distribution", "family"
OF_TARGETS, OF_SOURCES = "target.", "sources."  # how names begin
REPLICATES = ("seed", "sources.seed")  # what intervals are over


@dataclass(frozen=True)
class VariedSetting:
    """A setting that differs among runs, and its values in order: numbers as they rise, others as they were met."""

    name: str
    values: tuple[Value, ...]
    alike: tuple[str, ...] = ()  # names of the settings that differ in the same runs and never apart from it

    @property
    def numeric(self) -> bool:
        """Whether all values are numbers."""
        return all(isinstance(value, int | float) and not isinstance(value, bool) for value in self.values)


@dataclass(frozen=True)
class VariedRuns:
    """Runs, what they are set to, and what varies among them."""

    runs: tuple[ComparedRun, ...]
    known: tuple[Known, ...]  # of each run; a setting that means nothing to it is absent
    varied: tuple[VariedSetting, ...]  # without method and distribution
    method: VariedSetting  # with its options, as lines are labelled
    distribution: VariedSetting  # by its label

    @classmethod
    def of(cls, runs: Iterable[ComparedRun]) -> VariedRuns:
        """The runs, each once. UsageError where there are none."""
        once = tuple({run.name: run for run in runs}.values())
        if not once:
            raise UsageError("no runs were given; give at least two that differ in a setting")
        known = [_settings(run) for run in once]
        _leave_targets_unshifted(known)
        found = _merged([_setting(name, known) for name in _names(known)], known)
        lines = _lines(once, known, {setting.name for setting in found})
        for told, line, run in zip(known, lines, once, strict=True):
            told |= {METHOD: line, DISTRIBUTION: run.settings.family.label}
        method, distribution = _setting(METHOD, known), _setting(DISTRIBUTION, known)
        varied = tuple(setting for setting in found if len(setting.values) > 1)
        return cls(once, tuple(known), varied, method, distribution)

    def named(self, name: str, option: str) -> VariedSetting:
        """The setting that varies under this name, or one that differs with it; UsageError, with what varies, for another."""
        every = [
            *self.varied,
            *(one for one in (self.method, self.distribution) if len(one.values) > 1),
        ]
        name = name.strip().replace("-", "_")
        for spelled in (_whole, _last):
            found = [one for one in every if name in map(spelled, (one.name, *one.alike))]
            if len(found) == 1:
                return found[0]
            if found:
                several = " or ".join(one.name for one in found)
                raise UsageError(f"{option} {name} could be any of {several}; name one of them")
        if name in REPLICATES:
            raise UsageError(
                f"{option} {name}: seeds draw other sources and targets of one distribution, which is what intervals are over"
            )
        names = [one.name for one in every]
        if not names:
            raise UsageError(
                f"{option} {name}: no setting varies among these runs; give runs that differ in it"
            )
        hint = nearest(name, names)
        told = "" if hint.startswith("it is") else f"; what varies is {', '.join(names)}"
        raise UsageError(f"{option} {name} does not vary among these runs; {hint}{told}")

    def drawable(self, setting: VariedSetting) -> bool:
        """Whether several of its values were run with all other settings alike, by one method at least."""
        others = self.others(setting)
        lines: dict[tuple[object, ...], set[Value]] = {}
        for known in self.known:
            if setting.name in known:
                line = tuple(known.get(one.name) for one in (self.method, *others))
                lines.setdefault(line, set()).add(known[setting.name])
        return any(len(values) > 1 for values in lines.values())

    def others(self, *used: VariedSetting) -> list[VariedSetting]:
        """The settings that vary besides these and the method's.

        The distribution stands for all options of families, and where these differ it is put in their place.
        """
        names = {setting.name for setting in used}
        taken = names | {name for run in self.runs for name in _of_method(run)}
        family = _of_family(self.runs)
        several = len({run.settings.family.name for run in self.runs}) > 1
        within = any(family.intersection((setting.name, *setting.alike)) for setting in used)
        stands = DISTRIBUTION in names or (several and not within)
        found = [
            setting
            for setting in self.varied
            if setting.name not in taken
            and not (stands and family.intersection((setting.name, *setting.alike)))
            and not (within and setting.name == FAMILY)
        ]
        return [self.distribution, *found] if stands and DISTRIBUTION not in names else found

    def combinations(self, others: Sequence[VariedSetting], among: Where = ()) -> list[Where]:
        """The combinations of these settings that there are, in order; of those `among` the runs with these settings alone.

        A run that lacks settings counts in every combination that agrees in the others, and makes one of its own where none does.
        """
        met = [
            tuple((one.name, known[one.name]) for one in others if one.name in known)
            for known in self.known
            if all(known.get(name) == value for name, value in among)
        ]
        once = list(dict.fromkeys(met))
        whole = [one for one in once if not any(set(one) < set(other) for other in once)]
        places = {one.name: {value: at for at, value in enumerate(one.values)} for one in others}
        return sorted(whole, key=lambda where: [places[name][value] for name, value in where])

    def factors(self) -> list[VariedSetting]:
        """What the variance of the return is shared among; where families differ the distribution stands for their options."""
        return [*([self.method] if len(self.method.values) > 1 else []), *self.others()]


def _whole(name: str) -> str:
    return name.replace("-", "_")


def _last(name: str) -> str:
    """Without what it is a setting of: "tasks" of "sources.tasks"."""
    return _whole(name).rpartition(".")[2]


def _settings(run: ComparedRun) -> Known:
    """What decides the numbers of a run, but for the draws; a method that reads no sources has none of theirs."""
    settings = run.settings
    targets = {FAMILY: settings.family.name, **_options(settings.family)}
    found: Known = {}
    sources = settings.source_set
    own = {} if settings.imported else _learned(plain_learning(settings.learning))
    own["tasks"] = settings.tasks
    if settings.imported or not run.reads_sources:
        found |= targets | own | {f"{OF_TARGETS}{name}": value for name, value in targets.items()}
    else:
        found |= {FAMILY: sources.family.name, **_options(sources.family)} | own
        found |= {f"{OF_TARGETS}{name}": value for name, value in targets.items()}
        found[f"{OF_SOURCES}tasks"] = sources.tasks
        found[f"{OF_SOURCES}learner"] = sources.learner
        if sources.learner not in (EXACT, IMPORTED):
            learned = _learned(plain_learning(sources.learning, sources.learner))
            found |= {f"{OF_SOURCES}{name}": value for name, value in learned.items() if name != "learner"}
        else:
            found[f"{OF_SOURCES}gamma"] = sources.learning.gamma
        found |= {name: _value(getattr(sources.fitted, name)) for name in sources.given}
    found |= _of_method(run)
    return found


def _options(family: StoredFamily) -> Known:
    from dataclasses import fields

    options = {name: value for name, value in family.distribution().items() if name != "name"}
    here = getattr(family.here, "family", family.here)  # of tiles the family within
    order = [] if here is None else [one.name for one in fields(here)]  # type: ignore[arg-type]  # a dataclass
    # a default may follow from another option, as the mean from the size: the one that was given stands first
    ordered = sorted(options, key=lambda name: order.index(name) if name in order else len(order))
    return {key: value for name in ordered for key, value in _flat(name, options[name])}


def _learned(plain: Mapping[str, Any]) -> Known:
    """How tasks are learned; options of learner and exploration by their own names."""
    found: Known = {"learner": "q-learning", "explore": "epsilon-greedy"}
    for name, value in plain.items():
        if name in ("learner", "explore"):
            found[name] = value["name"]
            for option, own in value.items():
                if option != "name":
                    found[f"{name}.{option}" if option in plain else option] = _value(own)
        else:
            found[name] = _value(value)
    if found["explore"] != "epsilon-greedy":
        found.pop("epsilon", None)  # which then means nothing
    return found


def _of_method(run: ComparedRun) -> Known:
    stored = run.settings.method
    plain = {name: value for name, value in stored.spec().items() if name not in ("name", "label")}
    return {
        f"{stored.name}.{key.removesuffix('.name')}": value
        for name, given in plain.items()
        for key, value in _flat(name, given)
    }


def _flat(name: str, value: Any) -> Iterable[tuple[str, Value]]:
    if isinstance(value, Mapping):
        for key, within in value.items():
            yield from _flat(f"{name}.{key}", within)
    else:
        yield name, _value(value)


def _value(value: Any) -> Value:
    if isinstance(value, list | tuple):
        return " ".join(map(str, value))
    return "none" if value is None else value if isinstance(value, bool | int | float) else str(value)


def _leave_targets_unshifted(known: Sequence[Known]) -> None:
    """Takes away what is told of targets where no run's differ from its sources': in place."""
    shifted = {
        name
        for told in known
        for name, value in told.items()
        if name.startswith(OF_TARGETS) and told.get(name.removeprefix(OF_TARGETS)) != value
    }
    for told in known:
        unread = f"{OF_SOURCES}tasks" not in told
        for name in [name for name in told if name.startswith(OF_TARGETS)]:
            if name not in shifted:
                del told[name]
            elif unread:
                # a method that reads no sources: where targets are shifted theirs alone mean something
                told.pop(name.removeprefix(OF_TARGETS), None)


def _names(known: Sequence[Known]) -> list[str]:
    return list(dict.fromkeys(name for told in known for name in told))


def _setting(name: str, known: Sequence[Known]) -> VariedSetting:
    found = VariedSetting(name, tuple(dict.fromkeys(told[name] for told in known if name in told)))
    return VariedSetting(name, tuple(sorted(found.values, key=float))) if found.numeric else found


def _merged(settings: Sequence[VariedSetting], known: Sequence[Known]) -> list[VariedSetting]:
    """The settings of several values; of those that never differ apart one, which every run has that has the others.

    Of several such the earliest; the others are told as `alike`.
    """
    found: list[VariedSetting] = []
    for setting in (one for one in settings if len(one.values) > 1):
        for at, first in enumerate(found):
            kept, other = (setting, first) if _wider(setting.name, first.name, known) else (first, setting)
            if _implied(other.name, kept.name, known):
                alike = (*first.alike, other.name) if kept is first else (*first.alike, first.name)
                found[at] = VariedSetting(kept.name, kept.values, alike)
                break
        else:
            found.append(setting)
    return found


def _wider(first: str, second: str, known: Sequence[Known]) -> bool:
    """Whether more runs have the first setting than the second."""
    return sum(first in told for told in known) > sum(second in told for told in known)


def _implied(name: str, by: str, known: Sequence[Known]) -> bool:
    """Whether every run of the setting has the other too, and each value of either comes with one of the other."""
    if any(name in told and by not in told for told in known):
        return False
    pairs = {(told[by], told[name]) for told in known if name in told}
    had = [{told[each] for told in known if each in told} for each in (by, name)]
    return len(pairs) == len(had[0]) == len(had[1]) and {value for value, _ in pairs} == had[0]


def _lines(runs: Sequence[ComparedRun], known: Sequence[Known], varying: set[str]) -> list[str]:
    """The label of each run's method, with those of its options that vary."""
    labels = []
    for run, own in zip(runs, known, strict=True):
        options = [
            f"{name.removeprefix(f'{run.method}.')} {setting_text(own[name])}"
            for name in _of_method(run)
            if name in varying and name in own and setting_text(own[name]) not in run.label
        ]
        labels.append(", ".join([run.label, *options]))
    return labels


def _of_family(runs: Sequence[ComparedRun]) -> set[str]:
    return {FAMILY} | {
        name
        for run in runs
        for options in (_options(run.settings.family), _options(run.settings.source_set.family))
        for own in options
        for name in (own, f"{OF_TARGETS}{own}")
    }
