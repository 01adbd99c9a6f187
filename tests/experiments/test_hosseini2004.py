"""The thesis, reproduced: every printed number has a check, every difference a reason, every conclusion a verdict."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from palpate import devices
from palpate.errors import PalpateError
from riesz import riesz_derivative
from typer.testing import CliRunner

from experiments.hosseini2004 import reproduce
from experiments.hosseini2004.__main__ import app
from experiments.hosseini2004.checks import KINDS, Check, at_most, compare, statement, tally, within
from experiments.hosseini2004.conclusions import Sentence, judged, sentences
from experiments.hosseini2004.contents import STATES, items
from experiments.hosseini2004.errata import causes
from experiments.hosseini2004.experimental import experimental_model
from experiments.hosseini2004.printed_equations import PrintedArm
from experiments.hosseini2004.printed_numbers import keys, printed
from experiments.hosseini2004.reproduce import Reproduction

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def reproduced(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Reproduction, list[tuple[str, float]]]:
    """One whole run: its folder, its results and its progress reports."""
    out = tmp_path_factory.mktemp("reproduce")
    steps: list[tuple[str, float]] = []
    result = reproduce.run(out, lambda text, fraction: steps.append((text, fraction)))
    return out, result, steps


def test_every_difference_has_a_registered_reason(reproduced: Any) -> None:
    _, result, _ = reproduced
    assert result.counts.unexplained == []
    for check in result.checks:
        if check.status in ("differs", "not computed"):
            assert check.note or check.sense == "statement", check.id


def test_every_conclusion_is_decided_by_its_checks(reproduced: Any) -> None:
    _, result, _ = reproduced
    assert [s.says for s, verdict in result.conclusions if verdict == "undecided"] == []
    assert {verdict for _, verdict in result.conclusions} == {"confirmed", "refuted", "not testable"}
    assert result.expected


def test_results_are_what_others_script_against(reproduced: Any) -> None:
    out, result, _ = reproduced
    entries = json.loads((out / "results.json").read_text("utf-8"))
    assert entries == result.to_list()
    for entry in entries:
        assert {"id", "kind", "what", "printed", "computed", "unit", "tolerance", "status"} <= entry.keys()
        assert entry["kind"] in KINDS
        assert entry["status"] in ("match", "erratum", "differs", "not computed")
        assert ("cause" in entry) is (entry["status"] == "erratum") or entry["status"] == "differs"
    ids = [entry["id"] for entry in entries]
    assert len(ids) == len(set(ids))


def test_every_printed_number_has_a_check(reproduced: Any) -> None:
    """Each entry by itself, but the zeros of a matrix, the leading 1 of a denominator, and A_e and B_e as a whole."""
    _, result, _ = reproduced
    ids = {check.id for check in result.checks}
    for key in keys():
        p = printed(key)
        if key in ("eq3.31-A_e", "eq3.31-B_e"):
            assert key in ids
            continue
        for i, row in enumerate(p.rows):
            for j, text in enumerate(row):
                zero = float(text) == 0.0 and key.startswith(("eq3.26", "eq3.27", "eq3.28", "eq3.29", "eq3.30"))
                monic = "denominator" in key and j == 0
                name = f"{key}[zeros]" if p.dimensions == 2 and float(text) == 0.0 else p.entry_id(i, j)
                assert name in ids or zero or monic, name


def test_a_number_that_is_registered_as_not_reproduced_is_not(reproduced: Any) -> None:
    """No stale entry: what printed.toml calls different differs, and nothing else that is recomputed does."""
    _, result, _ = reproduced
    missed = {c.id for c in result.checks if c.status in ("differs", "not computed") and c.sense != "statement"}
    registered = {
        p.entry_id(i, j)
        for p in map(printed, keys())
        for i, row in enumerate(p.rows)
        for j in range(len(row))
        if p.difference(i, j)
    }
    assert registered - missed == {"tab3.1-nonlinear[1]"}  # ~0.0 along x, where the gain is assumed: no result
    # No number of the print: slides that rest in contact before the second stiffness.
    own = {f"sec5.6-pairs-lqg-normalized-{tangential}-unstable" for tangential in ("1", "none")}
    assert missed - registered == own


def test_table_2_1_is_checked_row_by_row(reproduced: Any) -> None:
    """Two rows are carried over, the resolution agrees, all others differ or cannot be computed."""
    _, result, _ = reproduced
    rows = {check.id: (check.kind, check.status) for check in result.checks if check.id.startswith("tab2.1-")}
    assert rows.pop("tab2.1-peak-force") == rows.pop("tab2.1-continuous-force") == ("carried", "match")
    assert rows.pop("tab2.1-resolution") == ("recomputed", "match")
    assert rows.pop("tab2.1-footprint[1]") == rows.pop("tab2.1-footprint[2]") == ("recomputed", "not computed")
    assert set(rows.values()) == {("recomputed", "differs")}
    assert {key.partition("[")[0] for key in rows} == {
        "tab2.1-stiffness", "tab2.1-apparent-mass", "tab2.1-friction", "tab2.1-workspace"
    }  # fmt: skip


def test_every_erratum_of_the_print_is_found(reproduced: Any) -> None:
    """The printed errata are exactly the entries whose print and computation disagree."""
    _, result, _ = reproduced
    found = {c.id for c in result.checks if c.status == "erratum" and isinstance(c.printed, float)}
    expected = set()
    for key in keys():
        p = printed(key)
        for i, row in enumerate(p.rows):
            expected |= {p.entry_id(i, j) for j in range(len(row)) if p.erratum(i, j) is not None}
    assert found == expected


def test_every_erratum_has_a_cause_and_every_cause_its_evidence(reproduced: Any) -> None:
    """Nine causes explain the errors of equations, matrices and tables; four causes are shown by the text alone."""
    _, result, _ = reproduced
    known = {cause.id: cause for cause in causes()}
    assert {c.cause for c in result.checks if c.status == "erratum"} <= known.keys()
    by_text = {id for id, cause in known.items() if not cause.shown_by(result.checks)}
    assert by_text == {"units-of-k", "reference-3.35", "model-of-case-B", "aluminum"}
    nine = [cause for cause in known.values() if cause.kind == "error" and cause.id not in by_text]
    assert len(nine) == 9
    assert sum(c.status == "erratum" and known[c.cause].kind == "error" for c in result.checks) == 19
    assert all(id in {check.id for check in result.checks} for cause in known.values() for id in cause.checks)


def test_every_loop_has_its_certificate(reproduced: Any) -> None:
    """Cases A to D and table 5.1, palpate's controllers: only case B with LQG is unstable, above 8.8 N/m."""
    _, result, _ = reproduced
    verdicts = {check.id: check.computed for check in result.checks if check.id.endswith("-certificate")}
    assert len(verdicts) == 8 + 10
    assert [name for name, verdict in verdicts.items() if verdict != "stable"] == ["caseB-lqg-certificate"]
    limits = {check.id: check.computed for check in result.checks if check.id.endswith("-certified-limit")}
    assert limits["caseB-lqg-certified-limit"] == pytest.approx(8.8, abs=0.05)
    assert limits["caseD-lqg-certified-limit"] == pytest.approx(7900, rel=1e-3)


def test_a_comparison_of_palpate_with_itself_is_no_printed_number(reproduced: Any) -> None:
    """What is recomputed starts with an equation or table of printed.toml; certificates, runs and fits do not count."""
    _, result, _ = reproduced
    for check in result.checks:
        if check.kind == "recomputed":
            assert check.id.partition("[")[0] in keys(), check.id
        if check.id.startswith(("ident-", "ch4.")) or "certif" in check.id or "-own" in check.id:
            assert check.kind in ("own", "identified"), check.id


def test_the_report_opens_with_the_conclusions(reproduced: Any) -> None:
    """One file, no network: conclusions first, then counts, errata, every figure of the thesis and each chapter."""
    out, result, _ = reproduced
    page = (out / "report.html").read_text("utf-8")
    anchors = re.findall(r'<h2 id="([^"]+)"', page)
    assert anchors[:4] == ["conclusions", "counts", "errata", "figures"]
    assert anchors[5:9] == [f"chapter-{number}" for number in (2, 3, 4, 5)]
    assert result.counts.sentence in page
    for text in ("A_ci", "C_ci", "A_di", "B_di", "C_di", "D_di", "Table 3.1", "Table 4.1", "Table 5.1", "Errata"):
        assert text in page, text
    assert page.count("<svg") >= 18
    assert not re.search(r'(?:src|href)="https?:', page)
    assert (out / "headline.png").stat().st_size > 10_000
    tables = [int(number) for number in re.findall(r"<b>Table (\d+)\.</b>", page)]
    assert tables == sorted(set(tables))


def test_every_figure_of_the_thesis_says_where_it_is_or_why_not(reproduced: Any) -> None:
    """57 figures and 4 tables, each once; a section named exists in the report; a missing one has a reason."""
    out, _, _ = reproduced
    titles = set(re.findall(r"<h[23][^>]*>([^<]+)</h[23]>", (out / "report.html").read_text("utf-8")))
    found: list[str] = []
    for item in items():
        assert item.state in STATES
        assert item.where in titles if item.where else item.state == "not reproduced", item.name
        assert item.why or item.state == "reproduced", item.name
        found += _names(item.name)
    figures = {"1": 2, "2": 13, "3": 9, "4": 21, "5": 10, "A": 9}
    expected = [f"figure {chapter}.{n}" for chapter, last in figures.items() for n in range(1, last + 1)]
    expected += ["table 2.1", "table 3.1", "table 4.1", "table 5.1"]
    assert sorted(found) == sorted(expected)


def _names(name: str) -> list[str]:
    """Split "figures 2.1 to 2.9", "figures 4.4 and 4.6" and "table 2.1" into their members."""
    kind = name.split(maxsplit=1)[0].rstrip("s")
    numbers = re.findall(r"([\dA])\.(\d+)", name)
    if " to " in name:
        (chapter, first), (_, last) = numbers
        numbers = [(chapter, str(n)) for n in range(int(first), int(last) + 1)]
    return [f"{kind} {chapter}.{number}" for chapter, number in numbers]


def test_the_documentation_states_the_counts_of_the_run(reproduced: Any) -> None:
    """README, validation overview and errata page: the counts, the sentences and the causes."""
    _, result, _ = reproduced
    counts = result.counts
    missed = counts.differ + counts.not_computed
    numbers = f"{counts.match} numbers match, {counts.errata} are errata, {missed} are not reproduced"
    for name in ("README.md", "docs/validation/index.md", "docs/validation/thesis.md"):
        assert numbers in (ROOT / name).read_text("utf-8"), name
    table = (ROOT / "docs/validation/thesis.md").read_text("utf-8")
    for kind, found in counts.kinds.items():
        cells = " | ".join(str(found[status]) for status in ("match", "erratum", "differs", "not computed"))
        assert f"`{kind}` | {cells} |" in table, kind
    verdicts = [verdict for _, verdict in result.conclusions]
    said = ", ".join(f"{verdicts.count(v)} {v}" for v in ("confirmed", "refuted", "not testable"))
    assert said in table
    for verdict in ("confirmed", "refuted", "not testable"):
        assert len(re.findall(rf"^\|[^|]+\|[^|]+\| {verdict}", table, re.MULTILINE)) == verdicts.count(verdict)
    page = (ROOT / "docs/validation/errata.md").read_text("utf-8")
    for cause in causes():
        assert f"`{cause.id}`" in page, cause.id


def test_progress_runs_from_nothing_to_done(reproduced: Any) -> None:
    _, _, steps = reproduced
    fractions = [fraction for _, fraction in steps]
    assert fractions[0] == 0.0
    assert fractions[-1] == 1.0
    assert np.all(np.diff(fractions) >= -1e-12)
    assert max(np.diff(fractions)) < 0.25


def test_nothing_is_written_unless_everything_was_computed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> None:
        raise RuntimeError("power cut")

    monkeypatch.setattr(reproduce, "CHAPTERS", ((fails, "chapter 5", 0.1),))
    monkeypatch.setattr(reproduce, "headline", lambda _: None)
    with pytest.raises(RuntimeError, match="power cut"):
        reproduce.run(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reproduce, "CHAPTERS", ())
    (tmp_path / "taken").write_text("a file, not a folder")
    with pytest.raises(PalpateError, match="taken"):
        reproduce.run(tmp_path / "taken")


# --- the judge itself: it must be able to say no ----------------------------------------------------------------------


def test_half_a_unit_in_the_last_printed_digit_is_the_tolerance() -> None:
    key = "eq2.84-theta3"  # printed 3.2776
    assert compare(key, 3.27764999)[0].status == "match"
    assert compare(key, 3.27755001)[0].status == "match"
    assert compare(key, 3.27766)[0].status == "differs"
    assert compare(key, 3.2775)[0].status == "differs"


def test_an_erratum_needs_the_right_value_and_not_the_printed_one() -> None:
    key = "tab4.1-1N-3.5"  # printed 0.26, right 0.286
    assert compare(key, 1 / 3.5)[0].status == "erratum"
    assert compare(key, 0.26)[0].status == "differs"
    assert compare(key, 0.3)[0].status == "differs"


def test_one_wrong_entry_of_a_matrix_is_one_that_differs() -> None:
    p = printed("eq3.42-C_di")
    good = p.values
    assert {check.status for check in compare(p.id, good)} == {"match"}
    bad = good.copy()
    bad[1, 2] *= -1
    assert [check.id for check in compare(p.id, bad) if check.status == "differs"] == ["eq3.42-C_di[2,3]"]
    bad = good.copy()
    bad[0, 1] = 1e-3  # printed 0
    assert [check.id for check in compare(p.id, bad) if check.status == "differs"] == ["eq3.42-C_di[zeros]"]


def test_a_matrix_of_another_shape_is_refused() -> None:
    with pytest.raises(ValueError, match=r"eq3\.42-C_di is printed with shape"):
        compare("eq3.42-C_di", np.zeros((2, 2)))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_number_that_is_not_finite_never_matches(value: float) -> None:
    assert compare("eq2.84-theta2", value)[0].status == "differs"
    assert at_most("x", "x", 1.0, value, "mm", kind="own").status == "differs"
    assert not at_most("x", "x", 1.0, value, "mm", kind="own", reason="known").known
    assert within("x", "x", 1.0, value, "mm", 10.0, kind="own").status == "differs"


def test_no_worse_than_printed_is_one_sided() -> None:
    assert at_most("x", "x", 0.3, 0.0, "mm", kind="bound").status == "match"
    assert at_most("x", "x", 0.3, 0.3001, "mm", kind="bound").status == "differs"


def test_a_sentence_without_evidence_differs() -> None:
    assert statement("x", "x", "a", "b", holds=True).status == "match"
    assert statement("x", "x", "a", "b", holds=True, cause="0.26").status == "erratum"
    refuted = statement("x", "x", "a", "b", holds=True, refuted=True)
    assert (refuted.status, refuted.known) == ("differs", True)
    for options in ({}, {"cause": "0.26"}, {"refuted": True}):
        missing = statement("x", "x", "a", "b", holds=False, **options)  # type: ignore[arg-type]
        assert (missing.status, missing.known) == ("differs", False)


def test_only_recomputed_numbers_count_as_matches() -> None:
    """A match of any other kind leaves the headline alone; a difference without a reason is listed."""
    number = compare("eq2.84-theta3", 3.2776)[0]
    others = [replace(number, id=kind, kind=kind) for kind in KINDS if kind != "recomputed"]
    counts = tally([number, *others])
    assert (counts.match, counts.errata, counts.differ, counts.not_computed) == (1, 0, 0, 0)
    wrong = compare("eq2.84-theta3", 3.0)[0]
    counts = tally([number, *others, wrong])
    assert (counts.match, counts.differ, counts.unexplained) == (1, 1, [wrong.id])


def test_a_known_difference_still_differs() -> None:
    """A reason in printed.toml explains a difference and does not hide it."""
    found = compare("eq3.36-k", [0.038, 0.001, 0.065])
    assert [check.status for check in found] == ["differs", "match", "differs"]
    assert [check.known for check in found] == [True, False, True]
    assert tally(found).differ == 2


def test_a_conclusion_whose_evidence_changes_is_undecided() -> None:
    """Confirmed needs matches, refuted needs errata or known differences; a missing check decides nothing."""
    good = statement("good", "x", "a", "b", holds=True)
    bad = statement("bad", "x", "a", "b", holds=True, refuted=True)
    lost = statement("lost", "x", "a", "b", holds=False, refuted=True)
    checks = {check.id: check for check in (good, bad, lost)}
    assert Sentence("1", "s", confirmed=("good",)).verdict(checks) == "confirmed"
    assert Sentence("1", "s", confirmed=("good", "bad")).verdict(checks) == "undecided"
    assert Sentence("1", "s", refuted=("bad",)).verdict(checks) == "refuted"
    assert Sentence("1", "s", refuted=("good",)).verdict(checks) == "undecided"
    assert Sentence("1", "s", refuted=("lost",)).verdict(checks) == "undecided"
    assert Sentence("1", "s", confirmed=("absent",)).verdict(checks) == "undecided"
    assert {verdict for _, verdict in judged([])} == {"undecided", "not testable"}


def test_every_concluding_section_of_the_thesis_is_gone_through() -> None:
    sections = {part for sentence in sentences() for part in sentence.section.split(", ")}
    assert {"2.8", "3.11", "4.5", "4.6", "5.7", "6"} <= sections


def test_the_command_fails_if_a_number_differs_without_a_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit code 1 and the name of the check; 0 if all is as registered."""
    wrong = compare("eq2.84-theta3", 3.0)[0]

    def result(checks: list[Check]) -> Reproduction:
        return Reproduction(checks, tally(checks), [(sentences()[0], "confirmed")])

    for checks, code in (([wrong], 1), ([], 0)):
        found = result(checks)
        monkeypatch.setattr(reproduce, "run", lambda *_, _found=found: _found)
        outcome = CliRunner().invoke(app, ["--out", str(tmp_path)])
        assert outcome.exit_code == code
        assert sentences()[0].says[:20] in outcome.output
        assert (wrong.id in outcome.output) is bool(checks)


# --- errata of the equations, each by a law of mechanics --------------------------------------------------------------


def test_printed_sign_of_c32_breaks_skew_symmetry() -> None:
    """dM/dt - 2C + transpose vanishes with our signs and not with the printed one of (2.73)."""
    arm = devices.load("phantom-premium-1.5a").frictionless()
    q, qd = np.array([0.3, 0.7, 2.0]), np.array([1.0, -2.0, 3.0])
    change = sum(riesz_derivative(arm.mass_matrix, q, joint) * qd[joint] for joint in range(3))
    for coriolis, skew in ((arm.coriolis(q, qd), True), (PrintedArm(arm, inertia=False).coriolis(q, qd), False)):
        rest = change - 2 * coriolis
        assert bool(np.abs(rest + rest.T).max() < 1e-15) is skew


def test_printed_sign_of_m23_is_not_the_one_of_the_printed_linear_model() -> None:
    """(3.41) follows from M23 with a minus: its velocity entries are -M^-1 k, whose signs off the diagonal tell."""
    arm = devices.load("phantom-premium-1.5a")
    q = np.array([0.0, 2.2305, 3.2776])
    table = printed("eq3.41-A_ci").values[1:, 4:]
    ours = -np.linalg.inv(arm.mass_matrix(q))[1:, 1:] * arm.viscous[1:]
    theirs = -np.linalg.inv(PrintedArm(arm).mass_matrix(q))[1:, 1:] * arm.viscous[1:]
    np.testing.assert_allclose(ours, table, rtol=0, atol=6e-5)
    assert np.sign(theirs[0, 1]) == -np.sign(table[0, 1])


def test_printed_coefficient_of_the_identified_model_explodes() -> None:
    """-1.1428 z^4 in (3.29), (3.30) puts a pole at 1.763; with -0.1428 none leaves the circle by more than rounding."""
    misprint = np.abs(np.roots(printed("eq3.29-denominator").values[0])).max()
    assert misprint == pytest.approx(1.763, abs=5e-4)
    assert np.abs(np.linalg.eigvals(experimental_model(integrating=False).A)).max() < 1.005
    assert np.abs(np.linalg.eigvals(experimental_model().A)).max() == pytest.approx(1.0, abs=1e-9)
