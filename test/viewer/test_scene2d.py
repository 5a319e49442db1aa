"""Moving picture of cam and follower: in contact the roller touches the contour."""

import numpy as np
import pytest

from cam_rig.profile.shapes import distances, rotate
from cam_rig.schema.load import config_root
from cam_rig.show.looks import of_cam
from cam_rig.simulation.scene import max_contact_force, open_scene
from cam_rig.viewer.scene2d import ARROW, FRAMES_PER_TURN, bounds, frame_mask, framings, readings

CAM, FOLLOWER, CONTOUR = "scene/rig/cam", "scene/rig/follower", "scene/rig/cam/contour"


def gap(point, outline):
    """Return the distance of a point to a closed polyline, both in the same unit.

    The polyline has the shape (n, 2).
    """
    start, along = outline[:-1], np.diff(outline, axis=0)
    fraction = np.sum((point - start) * along, axis=1) / np.sum(along**2, axis=1)
    foot = start + np.clip(fraction, 0.0, 1.0)[:, None] * along
    return float(np.hypot(*(point - foot).T).min())


def test_each_cam_replaces_the_previous_cam(bag, picture):
    """The moving picture has the closed contour of the mounted cam only.

    It is the recorded /cam/profile in mm.
    """
    strips = picture.column(CONTOUR, "LineStrips2D:strips")
    assert len(strips) == 2
    for strip, profile in zip(strips, bag.profiles.values(), strict=True):
        np.testing.assert_allclose(strip[0][:-1], profile * 1e3, atol=1e-4)
        assert strip[0][0] == strip[0][-1]
    half = bag.samples[0, bag.samples.shape[1] // 2]
    np.testing.assert_allclose(picture.time(CONTOUR), [0.0, half], atol=1e-3)


def test_the_picture_turns_the_cam_like_the_drive(bag, picture):
    """In each frame the drawn cam is rotated by its cam angle, counterclockwise."""
    time, quaternion = picture.time(CAM), picture.numbers(CAM, "Transform3D:quaternion")
    x, y, z, w = quaternion.T
    angle = np.interp(time, bag.samples[0], bag.angle)
    np.testing.assert_allclose(x, 0.0)
    np.testing.assert_allclose(y, 0.0)
    np.testing.assert_allclose(w + 1j * z, np.exp(0.5j * angle), atol=1e-6)


def test_the_roller_touches_the_turned_contour(bag, picture):
    """In contact the drawn roller's centre is one radius from the turned contour.

    The tolerance is 0.02 mm. In flight it is farther away.
    """
    time = picture.time(FOLLOWER)
    place = picture.numbers(FOLLOWER, "Transform3D:translation")[:, :2]
    _, _, z, w = picture.numbers(CAM, "Transform3D:quaternion").T
    strips = [np.array(row[0]) for row in picture.column(CONTOUR, "LineStrips2D:strips")]
    mounted = np.searchsorted(picture.time(CONTOUR), time, side="right") - 1
    sample = bag.sample_of(picture, FOLLOWER)
    force = bag.samples[4, sample]
    angle = 2.0 * np.arctan2(z, w)
    gaps = np.array(
        [gap(p, rotate(strips[m], a)) for p, m, a in zip(place, mounted, angle, strict=True)]
    )
    assert (force > 0.0).sum() > 200 and (force == 0.0).any()
    np.testing.assert_allclose(gaps[force > 0.0], 10.0, atol=0.02)
    assert gaps.min() > 9.98 and gaps[force == 0.0].max() > 10.5


def test_frames_come_at_equal_angles_across_blocks():
    """Frames of the moving picture are at equal cam angles.

    The division of the samples into blocks has no effect.
    """
    angle = np.linspace(0.0, 4.0 * np.pi, 5000, endpoint=False)
    step = angle[1]
    whole = frame_mask(angle, step)
    cut = np.concatenate([frame_mask(part, step) for part in np.split(angle, 8)])
    assert whole.sum() == 2 * FRAMES_PER_TURN
    np.testing.assert_array_equal(whole, cut)
    assert frame_mask(angle[::500], 500 * step).all()


def test_the_gap_is_drawn_in_flight_only(bag, picture):
    """In flight a vertical line with the length of the gap is drawn.

    In contact there is no line.
    """
    strips = picture.column("scene/rig/gap", "LineStrips2D:strips")
    sample = bag.sample_of(picture, "scene/rig/gap")
    flies = bag.samples[4, sample] == 0.0
    assert [len(row) for row in strips] == flies.astype(int).tolist()
    assert 10 < flies.sum() < 0.5 * flies.size
    for row, gap in zip(strips, bag.gap[sample], strict=True):
        if row:
            across, up = np.diff(row[0], axis=0)[0]
            assert across == pytest.approx(0.0, abs=1e-4) and up == pytest.approx(
                gap * 1e3, abs=1e-3
            )


def test_the_arrow_is_the_contact_force(bag, picture):
    """The drawn arrow has the contact force to scale, along the common normal.

    There is no arrow in flight.
    """
    vectors = picture.column("scene/rig/force", "Arrows2D:vectors")
    origins = picture.column("scene/rig/force", "Arrows2D:origins")
    sample = bag.sample_of(picture, "scene/rig/force")
    force = bag.samples[4, sample]
    assert [len(row) for row in vectors] == (force != 0.0).astype(int).tolist()
    half = bag.samples.shape[1] // 2
    touching = [k for k, row in enumerate(vectors) if row and sample[k] < half]
    height = np.array([vectors[k][0][1] for k in touching])
    scale = height / force[touching]
    slow = picture.time("scene/rig/force")[touching] < 0.4 - 1e-6
    for step, rpm in ((slow, 300.0), (~slow, 700.0)):
        longest = max_contact_force(bag.loaded, "poly345", rpm * np.pi / 30.0)
        height = framings(bag.loaded)["poly345"].height
        np.testing.assert_allclose(scale[step], ARROW * height / longest, rtol=1e-5)
    law = bag.loaded.laws["poly345"]
    config = bag.loaded.cams["poly345"].follower
    for k in touching[::20]:
        angle = bag.angle[sample[k]]
        distance = config.base_radius.si + config.roller + float(law(angle))
        slope = -float(law(angle, 1)) / distance
        x, y = vectors[k][0]
        assert x / y == pytest.approx(slope, abs=1e-5)
        lean = np.array([x, y]) / np.hypot(x, y)
        centre = np.array(origins[k][0]) + config.roller * 1e3 * lean
        np.testing.assert_allclose(centre, [0.0, distance * 1e3], atol=1e-3)


def test_title_speed_and_force_bar_are_below_the_cam(bag, picture):
    """Title and speed are displayed in the colour of the cam.

    The bar below is a power of ten of the force, on the scale of the arrow.
    """
    cams = ("poly345", "poly345", "bezier15", "bezier15")
    labels = [row[0] for row in picture.column("scene/rig/label", "Points2D:labels")]
    assert labels[1] == "Polynomial 3-4-5, 700 rpm"
    colours = [row[0] for row in picture.column("scene/rig/label", "Points2D:colors")]
    assert colours == [of_cam(cam) for cam in cams]
    bars = picture.column("scene/rig/bar", "LineStrips2D:strips")
    words = picture.column("scene/rig/bar/words", "Points2D:labels")
    for bar, (label,), cam, rpm in zip(bars, words, cams, (300.0, 700.0) * 2, strict=True):
        (foot, top), force = bar[0], float(label.removesuffix(" N"))
        longest = max_contact_force(bag.loaded, cam, rpm * np.pi / 30.0)
        scale = ARROW * framings(bag.loaded)[cam].height / longest
        assert top[1] - foot[1] == pytest.approx(force * scale, rel=1e-4)
        assert 0.1 * longest < force <= longest
        assert np.log10(force) == round(np.log10(force))


@pytest.mark.parametrize("scene", ["tm21_sweep", "quick"])
def test_the_arrow_is_visible_at_every_speed(scene):
    """At any speed the arrow of the preload is longer than 1/100 of the view.

    The arrow displays a contact force.
    """
    loaded = open_scene(config_root() / "scenes" / f"{scene}.yaml")
    for cam in loaded.cams:
        slowest = min(loaded.scene.schedule.speeds.si_list)
        share = ARROW * loaded.follower.preload / max_contact_force(loaded, cam, slowest)
        assert share > 0.01


@pytest.mark.parametrize("cam", ["oscillating_roller", "oscillating_flat", "flat", "poly345"])
def test_the_follower_covers_no_number_of_the_ring(make_loaded_scene, cam):
    """The follower covers no visible angle number around the cam.

    This applies at any lift. At least six numbers are visible.
    """
    framing = framings(make_loaded_scene(cams=[cam]))[cam]
    places, numbers = framing.numbers()
    assert len(numbers) >= 6
    for lift in np.linspace(0.0, framing.shape.max_lift, 50)[:, None]:
        place, tilt = framing.shape.origin(lift)[0] * 1e3, float(framing.shape.turn(lift)[0])
        for strip in framing.follower():
            assert distances(places, rotate(strip, tilt) + place).min() > 0.1 * framing.ring


def test_a_follower_outside_its_view_is_drawn_at_the_edge():
    """A follower above the view of the picture is drawn at the view's edge.

    The displayed readings contain its lift and the lift at which it is drawn.
    """
    one = np.ones(1)
    words = readings(one, 5000.0, 0.2 * one, 0.0 * one, 0.1 * one, one, max_lift=0.065)[0]
    assert "lift    200.000 mm" in words and "drawn at 65 mm" in words
    words = readings(one, 5000.0, 0.06 * one, 0.0 * one, 0.1 * one, one, max_lift=0.065)[0]
    assert "not touched" in words


def test_cam_and_follower_are_completely_visible(bag, picture):
    """Contour, angle ring, guide and follower are within the moving picture.

    This is so even at the highest lift.
    """
    (left, right), (top, bottom) = bounds(framings(bag.loaded))
    zoom = picture.numbers("scene/rig", "Transform3D:mat3x3").reshape(-1, 3, 3)
    place = picture.numbers(FOLLOWER, "Transform3D:translation")[:, :2]
    outlines = picture.column("scene/rig/follower/outline", "LineStrips2D:strips")
    for i, strips in enumerate(outlines):
        fixed = [
            np.array(strip)
            for part in ("ring", "guide", "cam/contour", "bar")
            for strip in picture.column(f"scene/rig/{part}", "LineStrips2D:strips")[i]
        ]
        highest = place[place[:, 1].argmax()]
        moved = [np.array(strip) + highest for strip in strips]
        x, y = (np.concatenate(fixed + moved) * np.diag(zoom[i])[:2]).T
        assert left <= x.min() and x.max() <= right
        assert top <= y.min() and y.max() <= bottom


def test_the_readings_are_those_of_the_frame(bag, picture):
    """The readings (text) next to the moving picture belong to its frame.

    They are angle, lift and force. In flight they contain the gap, and in contact the pressure
    angle.
    """
    words = [row[0] for row in picture.column("scene_readings", "TextDocument:text")]
    sample, gaps = bag.sample_of(picture, "scene_readings"), bag.gap * 1e6
    half = bag.samples.shape[1] // 2
    for text, i in zip(words, sample, strict=True):
        theta, lift, force = (line.split() for line in text.splitlines()[1:4])
        degrees = np.degrees(bag.angle[i]) % 360.0
        assert float(theta[1][:-1]) == pytest.approx(degrees, abs=0.051)
        assert float(lift[1]) == pytest.approx(bag.samples[1, i] * 1e3, abs=5.1e-4)
        assert float(force[1]) == pytest.approx(bag.samples[4, i], abs=0.051)
        if bag.samples[4, i] == 0.0:
            assert lift[3] == "gap" and float(lift[4]) == pytest.approx(gaps[i], rel=1e-3)
        else:
            assert lift[3:] == ["in", "contact"]
            cam = "poly345" if i < half else "bezier15"
            law, config = bag.loaded.laws[cam], bag.loaded.cams[cam].follower
            distance = config.base_radius.si + config.roller + float(law(bag.angle[i]))
            lean = np.degrees(np.arctan(abs(float(law(bag.angle[i], 1))) / distance))
            assert float(force[-1][:-1]) == pytest.approx(lean, abs=0.051)
