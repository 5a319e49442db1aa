"""Samples per second beside a copy of the same bytes: what is counted, and what is compared."""

from benchmark.speed import cases as rate
from cam_rig.show.tables import to_markdown


def test_each_rate_has_its_copy(monkeypatch):
    """Two models at two speeds in one block, with a copy each; the ratio is that of the two."""
    monkeypatch.setattr(rate, "REPEATS", 2)
    found = rate.sample_rates(blocks=(2048,))
    assert [(one.model, one.rpm) for one in found] == [
        (model, rpm) for rpm in rate.SPEEDS_RPM for model in rate.SAMPLED
    ]
    for one in found:
        assert min(one.copied_per_s, one.samples_per_s, one.ratio) > 0.0
    text = to_markdown(rate.rate_table(found))
    assert text.count("\n| ") == 1 + 1 + len(found)
    assert "time over a copy's" in text


def test_a_copy_moves_what_a_block_holds(monkeypatch):
    """Both are timed on arrays of the same bytes; medians, the ratio's of the pairs."""
    sizes = []

    def timed(*works):
        made, copied = (work() for work in works)
        sizes.append((made[1].rows.nbytes, copied.nbytes))
        return [(1.0, 2.0), (6.0, 4.0), (2.0, 2.0)]

    monkeypatch.setattr(rate, "_seconds", timed)
    found = rate.sample_rates(blocks=(1000,))
    assert set(sizes) == {(6 * 1000 * 8, 6 * 1000 * 8)}
    assert {one.ratio for one in found} == {1.0}
    assert {(one.samples_per_s, one.copied_per_s) for one in found} == {(500.0, 500.0)}
