"""Order selection for ARX models: information criteria on training data, cross validation on the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array
from palpate.errors import RecordingError
from palpate.identification.arx_models import arx
from palpate.identification.recording import Recording

Structure = tuple[ArrayLike, ArrayLike, ArrayLike]


@dataclass(frozen=True)
class Candidate:
    """Structure of a model, and its criteria.

    Attributes:
        na, nb, nk: as in `arx`.
        count: coefficients.
        aic, bic: n log det of the residuals' covariance + 2 count (Akaike 1974) or + count log n (Schwarz 1978).
        mdl: det of the residuals' covariance times 1 + count log n / n (Rissanen 1983), as a logarithm, times n.
        one_step, free_run: (outputs,) NRMSE in percent on the part not used; -inf where the free run diverges.
    """

    na: ArrayLike
    nb: ArrayLike
    nk: ArrayLike
    count: int
    aic: float
    bic: float
    mdl: float
    one_step: Array
    free_run: Array


@dataclass(frozen=True)
class OrderTable:
    """Candidates in the order given, and the index of the best by each criterion."""

    candidates: list[Candidate]
    best: dict[str, int] = field(default_factory=dict)

    def chosen(self, criterion: str = "free_run") -> Candidate:
        """Return the best candidate by "aic", "bic", "mdl", "one_step" or "free_run"."""
        if criterion not in self.best:
            raise RecordingError(f"there is no criterion '{criterion}'; take one of {', '.join(self.best)}")
        return self.candidates[self.best[criterion]]

    def __str__(self) -> str:
        lines = [f"{'':3}{'coefficients':>13}{'AIC':>12}{'BIC':>12}{'MDL':>12}  one-step %  free run % (worst output)"]
        for i, c in enumerate(self.candidates):
            marks = ",".join(name for name, place in self.best.items() if place == i)
            lines.append(
                f"{i:<3}{c.count:>13}{c.aic:>12.0f}{c.bic:>12.0f}{c.mdl:>12.0f}"
                f"{c.one_step.min():>12.2f}{c.free_run.min():>12.2f}  {marks}"
            )
        return "\n".join(lines)


def select_order(recording: Recording, structures: Sequence[Structure], *, fraction: float = 0.7) -> OrderTable:
    """Fit each structure to the first `fraction` of a recording, and validate it on the rest.

    The criteria compare the errors in the samples that every structure predicts.

    Raises:
        RecordingError: no structure given, or the recording is too short or excites too little for one of them.
    """
    if not structures:
        raise RecordingError("give at least one structure (na, nb, nk) to choose from")
    seen, unseen = recording.split(fraction)
    candidates = []
    models = [arx(seen, *structure) for structure in structures]
    residuals = [model.residuals(seen) for model in models]
    n = min(len(error) for error in residuals)
    for (na, nb, nk), model, own in zip(structures, models, residuals, strict=True):
        error, count = own[-n:], model.count
        log_det = float(np.linalg.slogdet(error.T @ error / n)[1])
        try:
            fit = model.fit(unseen)
            one_step, free_run = fit.one_step, fit.free_run
        except RecordingError:
            one_step = free_run = np.full(recording.dof, -np.inf)
        penalty = count * np.log(n)
        aic, bic = n * log_det + 2 * count, n * log_det + penalty
        mdl = n * (log_det + float(np.log1p(penalty / n)))
        candidates.append(Candidate(na, nb, nk, count, aic, bic, mdl, one_step, free_run))
    best = {name: int(np.argmin([getattr(c, name) for c in candidates])) for name in ("aic", "bic", "mdl")}
    best |= {name: int(np.argmax([getattr(c, name).min() for c in candidates])) for name in ("one_step", "free_run")}
    return OrderTable(candidates, best)
