"""The settings in which artefacts that are shown together differ, in few words.

Every table, list, picture and page takes its names from here, so that two names are equal only if no setting differs, and no
name is a hash.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from qinit_cli.artefacts.kinds import KINDS
from qinit_cli.learners import LEARNERS, QLearner
from qinit_cli.learners.exploration import EpsilonGreedy
from qinit_cli.learning import EXACT, IMPORTED
from qinit_store.wording import counted as number_of

if TYPE_CHECKING:
    from qinit_cli.artefacts.settings import Settings, SourceSet, StoredFamily

Spec = Mapping[str, Any]
# settings such as "gamma 0.9" by a key; those of the same key are compared
Words = dict[str, str]

# not settings, or taken apart below
APART = ("kind", "family", "learning", "method", "source_set", "sources", "inputs", "grid", "files")
ITSELF = ("learner", "explore", "estimator", "role")  # settings whose values need no name: "exact", "umvue"
RECORDED = ("keep_q", "evaluate_every")  # what a run keeps changes none of its numbers
OF_METHOD, OF_RECORD, OF_SOURCES = "method", "recorded", "sources"  # how the keys of such settings begin
SHORT = 8  # digits of a hash
THEIRS = "sources' "


def settings(told: Settings | SourceSet, *, reads_sources: bool = True, labelled: bool = True) -> Words:
    """The settings of an artefact in words; of a source set those of the fit that its replicates share.

    Learning settings are compared within a family, a method's options among methods of one label, which names some of them; so
    are a family's own where its label names the artefact (`labelled`). The settings of its sources belong to a fit, and to a run
    whose method `reads_sources`.
    """
    from qinit_cli.artefacts.settings import FitSettings, RunSettings, SourceSet, TuningSettings

    found: Words = {}
    match told:
        case FitSettings() | TuningSettings():
            found |= settings(told.sources, labelled=labelled)
        case RunSettings() if reads_sources:
            found |= _of_sources(told.source_set, told.family)
        case SourceSet():
            found |= dict(_own(_drawn(told), told.family, labelled=labelled))
            return found | dict(
                _own({name: getattr(told.fitted, name) for name in told.given}, None, labelled=labelled)
            )
    family = None if isinstance(told, FitSettings) else told.sources.family
    return found | dict(_own(told.spec(), family, labelled=labelled))


def seed_key(fitted: SourceSet) -> str:
    """The key of the seed of a run's sources, which the run itself does not know."""
    return f"{OF_SOURCES} {fitted.family.name} seed"


def seed_word(seed: int) -> str:
    """The word of that key."""
    return f"{THEIRS}{_word('seed', seed)}"


def told_apart(found: Sequence[Words]) -> list[Words]:
    """Of the settings of each, those that differ in another which has them too."""
    words: dict[str, set[str]] = {}
    for one in found:
        for key, word in one.items():
            words.setdefault(key, set()).add(word)
    differing = {key for key, own in words.items() if len(own) > 1}
    differing -= {key for key in differing if all(_said_already(key, one) for one in found)}
    return [{key: word for key, word in one.items() if key in differing} for one in found]


def joined(words: Words) -> str:
    """ "gamma 0.9, exact": each word once."""
    return ", ".join(dict.fromkeys(words.values()))


def distinctions(several: Sequence[Settings | SourceSet], *, labelled: bool = True) -> list[str]:
    """The settings that distinguish each of these artefacts, "" where none does; `labelled` as in `settings`.

    Settings that change no number, such as --keep-q, are left out.
    """
    return distinguished([settings(told, labelled=labelled) for told in several])


def distinguished(several: Sequence[Words]) -> list[str]:
    """The same of settings that are in words already."""
    apart = told_apart(several)
    return [
        joined({key: word for key, word in words.items() if not key.startswith(OF_RECORD)}) for words in apart
    ]


def separator(labels: Sequence[str]) -> str:
    """What stands between labels in a sentence: a comma, unless there are commas in them."""
    return "; " if any("," in label for label in labels) else ", "


def with_words(name: str, words: str) -> str:
    """The name and the words behind it, if any."""
    return f"{name}, {words}" if words else name


def above_words(name: str, words: str) -> str:
    """The name and the words on a second line, if any: for the title of a panel."""
    return f"{name}\n{words}" if words else name


def _drawn(told: SourceSet) -> Spec:
    shared = told.shared()
    return {"kind": "sources", **{name: shared[name] for name in ("family", "learner", "learning", "tasks")}}


def _own(plain: Spec, family: StoredFamily | None, *, labelled: bool) -> Iterator[tuple[str, str]]:
    within = "" if family is None else family.name
    if family is not None:
        label = family.label if labelled else f"{within} family"
        for name, value in _flat(family.options):
            yield f"{label} {name}", _word(name, value)
    for name, value in plain.items():
        if name not in APART:
            noun = KINDS[plain["kind"]].counted if name == "tasks" and plain.get("kind") in KINDS else name
            yield (
                f"{OF_RECORD if name in RECORDED else within} {name}",
                _word(noun, value, counted=name == "tasks"),
            )
    if files := plain.get("files"):  # of imported tables nothing else may differ
        yield f"{within} files", f"{number_of(len(files), 'file')} from {files[0][:SHORT]}"
    for key, word in _learned(plain):
        yield f"{within} {key}", word
    method = plain.get("method", {})
    for name, value in _flat({key: part for key, part in method.items() if key not in ("name", "label")}):
        yield f"{OF_METHOD} {method.get('label')} {name}", _word(name, value)


def _learned(plain: Spec) -> Iterator[tuple[str, str]]:
    """How tasks are learned, with learner and exploration though they be the usual ones, which are not stored.

    Where steps explore by another rule epsilon means nothing, and to some learners alpha.
    """
    learning = plain.get("learning", {})
    idle = {"epsilon"} if "explore" in learning else set()
    if learning and plain.get("learner") not in (EXACT, IMPORTED):
        learning = {"learner": {"name": QLearner.name}, "explore": {"name": EpsilonGreedy.name}} | learning
        kind = LEARNERS.get(learning["learner"]["name"])
        idle |= set() if kind is None or kind.steps else {"alpha"}
    for name, value in _flat(learning):
        first, _, option = name.partition(" ")
        if name not in idle:
            yield f"learning {name}", _word(option or first, value)


def _said_already(key: str, words: Words) -> bool:
    """Whether the sources' setting is that of the targets too."""
    return key not in words or (
        words[key].startswith(THEIRS) and words[key].removeprefix(THEIRS) in words.values()
    )


def _of_sources(fitted: SourceSet, targets: StoredFamily) -> Words:
    """How the sources of a run were drawn, learned and fitted, and whether its `targets` are of their family."""
    within, own = f"{OF_SOURCES} {fitted.family.name}", fitted.family
    unshifted = own.distribution() == targets.distribution()
    found: Words = {f"{within} family": "unshifted" if unshifted else f"sources of {own.label}"}
    shared = fitted.shared() | ({} if fitted.seed is None else {"seed": fitted.seed})
    for key, word in _learned(shared):
        found[f"{within} {key}"] = f"{THEIRS}{word}"
    for name, value in shared.items():
        if name not in APART:
            # targets have seeds and learners of their own, but for the exact one
            theirs = THEIRS if name in ("seed", "learner") and value not in (EXACT, IMPORTED) else ""
            word = _word("sources" if name == "tasks" else name, value, counted=name == "tasks")
            found[f"{within} {name}"] = theirs + word
    return found


def _flat(settings: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Nested settings by one name each: "init q"."""
    for key, value in settings.items():
        name = f"{above} {key}".strip()
        if isinstance(value, Mapping):
            yield from _flat(value, name)
        else:
            yield name.removesuffix(" name"), value


def _word(name: str, value: Any, *, counted: bool = False) -> str:
    """A setting as it is said: "gamma 0.9", "200 targets", "no holdout"."""
    shown = name.replace("_", "-")
    if value is None or value is False:
        return f"no {shown}"
    if value is True:
        return shown
    text = (
        f"{value:.10g}"
        if isinstance(value, float)
        else ", ".join(map(str, value))
        if isinstance(value, list)
        else str(value)
    )
    return f"{text} {shown}" if counted else text if name in ITSELF else f"{shown} {text}"
