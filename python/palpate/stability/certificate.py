"""Certificate of a scenario's servo loop: the claim, its assumptions, margins and method."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from html import escape
from pathlib import Path
from typing import Any, Final

import numpy as np

from palpate.files import check_suffix, write_json
from palpate.simulation.verdict import State, Verdict
from palpate.stability.counter_example import CounterExample

__all__ = ["Certificate"]

UNITS = {
    "_N_s_per_m": " N s/m",
    "_N_per_m": " N/m",
    "_N": " N",
    "_m": " m",
    "_Hz": " Hz",
    "_deg": " deg",
    "_s": " s",
}  # suffix of a margin's name to its unit
_SMALL: Final = 0.1  # s or m: a smaller number is written in ms or mm
# By the name of a margin: its meaning by value; None: of any other value.
_REMARKS: Final[dict[str, dict[float | None, str]]] = {
    "gain_margin": {math.inf: "stable at every larger gain", None: "largest stable factor on the gain of the loop"},
    "gain_reduction_margin": {
        0.0: "stable at every smaller gain",
        None: "smallest stable factor on the gain of the loop",
    },
}


@dataclass(frozen=True)
class Certificate:
    """Claim about the stability of a scenario's loop, and its justification.

    Attributes:
        title: title of the scenario.
        verdict: State.STABLE, UNSTABLE or UNDECIDED, with the reason.
        assumptions: conditions under which the claim holds, each a sentence.
        margin: numbers with their unit in the name; empty if nothing is claimed.
        method: how the claim was derived and checked, each a sentence.
        criteria: verdict of each criterion ("eigenvalues", "Jury", "Routh", "Lyapunov") on its own; on a deformable
            body as `ContactStability.criteria`.
        passive: whether the display is passive, hence stable with every passive operator; None: not tested or open.
        counter_example: a scenario that demonstrates an instability; None if there is none.
        scenario: tables of the scenario.
    """

    title: str
    verdict: Verdict
    assumptions: tuple[str, ...]
    margin: Mapping[str, float]
    method: tuple[str, ...]
    criteria: Mapping[str, bool]
    passive: bool | None = None
    counter_example: CounterExample | None = None
    scenario: Mapping[str, Any] = field(default_factory=dict)

    @property
    def stable(self) -> bool:
        """Whether stability is claimed."""
        return self.verdict.state is State.STABLE

    @property
    def claim(self) -> str:
        """The verdict in words."""
        words = str(self.verdict)
        return words[0].upper() + words[1:]

    def __str__(self) -> str:
        lines = [self.claim, "", "Assumptions:", *(f"  - {sentence}" for sentence in self.assumptions)]
        if self.margin:
            lines += ["", "Margins:", *(_margin_line(name, value) for name, value in self.margin.items())]
        lines += ["", "Method:", *(f"  - {sentence}" for sentence in self.method)]
        if self.counter_example is not None:
            lines += ["", f"Counter-example: {self.counter_example.sentence}"]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """Return the certificate for a notebook."""
        rows = (_margin_line(name, value).split(": ", 1) for name, value in self.margin.items())
        margins = "".join(f"<tr><td>{escape(name.strip())}</td><td>{escape(value)}</td></tr>" for name, value in rows)
        holds, method = ("".join(f"<li>{escape(one)}</li>" for one in part) for part in (self.assumptions, self.method))
        example = "" if self.counter_example is None else f"<p>{escape(self.counter_example.sentence)}</p>"
        return (
            f"<p><b>{escape(self.title)}</b>: {escape(self.claim)}</p><table><tbody>{margins}</tbody></table>{example}"
            f"<details><summary>Assumptions and method</summary><ul>{holds}</ul><ul>{method}</ul></details>"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the certificate for JSON; infinities become text. The verdict has the keys of a run's summary."""
        fields: dict[str, Any] = _plain(asdict(self))
        verdict = {
            "stable": self.stable,
            "state": self.verdict.state.label,
            "verdict": self.claim,
            "judgment": self.verdict.to_dict(),
        }
        return {**fields, **verdict}

    def save(self, path: str | Path) -> Path:
        """Write the certificate atomically as `.json` and return the path.

        Raises:
            OutputError: the suffix is not `.json`, or the file cannot be written.
        """
        return write_json(check_suffix(path, (".json",), "a certificate"), self.to_dict(), indent=2)


def _margin_line(name: str, value: float) -> str:
    suffix = next((end for end in UNITS if name.endswith(end)), "")
    unit = UNITS.get(suffix, "")
    if suffix in ("_s", "_m") and abs(value) < _SMALL:
        value, unit = 1e3 * value, f" m{suffix[1:]}"
    digits = 9 if name.startswith("spectral_radius") else 5  # the difference of a radius from 1 is significant
    remark = _REMARKS.get(name, {}).get(value, _REMARKS.get(name, {}).get(None, ""))
    return f"  {name.removesuffix(suffix).replace('_', ' ')}: {value:.{digits}g}{unit}{remark and f' ({remark})'}"


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value
