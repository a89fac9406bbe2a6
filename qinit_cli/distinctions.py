"""What tells artefacts that are shown together apart: the settings in which they differ, in the fewest words.

Every table, list, picture and page takes its names from here, so that no two of what it shows are called the same while a setting
tells them apart, and no name is a hash.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from qinit_cli.environments import label_of

Spec = Mapping[str, Any]
Settings = dict[
    str, str
]  # words such as "gamma 0.9", by a key: settings are compared where their keys are the same

APART = (
    "kind",
    "family",
    "learning",
    "method",
    "source_set",
    "sources",
    "inputs",
    "grid",
)  # not settings, or told by parts
ITSELF = ("learner", "estimator", "role")  # settings whose values need no name: "exact", "umvue"
RECORDED = ("keep_q", "evaluate_every")  # what a run keeps changes none of its numbers
OF_METHOD, OF_RECORD, OF_SOURCES = "method", "recorded", "sources"  # how the keys of such settings begin
THEIRS = "sources' "
COUNTED = {"sources": "sources", "fit": "sources", "run": "targets", "tuning": "sources"}  # what `tasks` are


def settings(spec: Spec, *, reads_sources: bool = True, labelled: bool = True) -> Settings:
    """The settings of an artefact in words.

    Learning is compared within a family, the method's options among what has one label, which names some of them; so are the
    family's own where the artefact is called by its label (`labelled`). A fit's sources are settings of the fit, a run's as far
    as its method `reads_sources`.
    """
    found: Settings = {}
    if "sources" in spec:
        found |= settings({**spec["sources"], "kind": "sources"}, labelled=labelled)
    elif "source_set" in spec and reads_sources:
        found |= _of_sources(spec["source_set"], spec.get("family"))
    return found | dict(_own(spec, labelled=labelled))


def told_apart(found: Sequence[Settings]) -> list[Settings]:
    """Of the settings of each, those in which another that has them too differs."""
    words: dict[str, set[str]] = {}
    for one in found:
        for key, word in one.items():
            words.setdefault(key, set()).add(word)
    differing = {key for key, own in words.items() if len(own) > 1}
    differing -= {key for key in differing if all(_said_already(key, one) for one in found)}
    return [{key: word for key, word in one.items() if key in differing} for one in found]


def joined(words: Settings) -> str:
    """ "gamma 0.9, exact": each word once."""
    return ", ".join(dict.fromkeys(words.values()))


def distinctions(specs: Sequence[Spec], *, labelled: bool = True) -> list[str]:
    """What tells each of these artefacts from the others, "" where no setting does; `labelled` as in `settings`.

    What a run keeps beside its numbers is not told.
    """
    apart = told_apart([settings(spec, labelled=labelled) for spec in specs])
    return [
        joined({key: word for key, word in words.items() if not key.startswith(OF_RECORD)}) for words in apart
    ]


def separator(labels: Sequence[str]) -> str:
    """What stands between labels in a sentence: a comma, unless there are commas in them."""
    return "; " if any("," in label for label in labels) else ", "


def with_words(name: str, words: str) -> str:
    """The name and the words behind it, if any."""
    return f"{name}, {words}" if words else name


def _own(spec: Spec, *, labelled: bool) -> Iterator[tuple[str, str]]:
    family = spec.get("family", {})
    within = family.get("name", "")
    label = label_of(spec) if family and labelled else f"{within} family"
    for name, value in _flat({key: part for key, part in family.items() if key != "name"}):
        yield f"{label} {name}", _word(name, value)
    for name, value in spec.items():
        if name not in APART:
            noun = COUNTED.get(str(spec.get("kind")), name) if name == "tasks" else name
            yield (
                f"{OF_RECORD if name in RECORDED else within} {name}",
                _word(noun, value, counted=name == "tasks"),
            )
    for name, value in _flat(spec.get("learning", {})):
        yield f"{within} learning {name}", _word(name, value)
    method = spec.get("method", {})
    for name, value in _flat({key: part for key, part in method.items() if key not in ("name", "label")}):
        yield f"{OF_METHOD} {method.get('label')} {name}", _word(name, value)


def _said_already(key: str, settings: Settings) -> bool:
    """Whether the sources' setting is that of the targets too."""
    return key not in settings or (
        settings[key].startswith(THEIRS) and settings[key].removeprefix(THEIRS) in settings.values()
    )


def _of_sources(fitted: Spec, targets: Any) -> Settings:
    """How the sources of a run were drawn, learned and fitted, and whether its `targets` are of their family."""
    found: Settings = {}
    within = f"{OF_SOURCES} {fitted.get('family', {}).get('name', '')}"
    if "family" in fitted:
        found[f"{within} family"] = (
            "unshifted" if fitted["family"] == targets else f"sources of {label_of(fitted)}"
        )
    for name, value in _flat(fitted.get("learning", {})):
        found[f"{within} learning {name}"] = f"{THEIRS}{_word(name, value)}"
    for name, value in fitted.items():
        if name not in (*APART, "sources"):
            theirs = THEIRS if name == "seed" else ""
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
