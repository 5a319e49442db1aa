"""All findings of a report, and the jobs that compute them."""

from __future__ import annotations

import base64
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.jump.jump_speed import FROM_REST
from cam_rig.files import no_room, temporary_folder
from cam_rig.law_design.pareto_front import paper_designs
from cam_rig.law_design.tables import LawDesign
from cam_rig.laws import Law
from cam_rig.laws import figures as law_figures
from cam_rig.laws.cam import CamSet, open_cam_set
from cam_rig.laws.catalogue import families
from cam_rig.paper import flywheel as flywheel_module
from cam_rig.paper.as_cut import figures as as_cut_plot
from cam_rig.paper.as_cut.study import BASES, CUT, ROLLERS, AsCut, CutBench, cut_all, over_sizes
from cam_rig.paper.contact import figures as contact_plot
from cam_rig.paper.contact.comparison import (
    ContactResult,
    PlayRow,
    compare_contacts,
    find_play,
    open_form_closed,
)
from cam_rig.paper.factorial import figures as factorial_plot
from cam_rig.paper.factorial.study import (
    Bench,
    Factorial,
    FactorialConfig,
    open_factorial,
    run_factorial,
)
from cam_rig.paper.flywheel import FLYWHEEL_RPM, FlywheelStudy, study_flywheel
from cam_rig.paper.jump import figures as jump_plot
from cam_rig.paper.jump.comparison import (
    BY_SEGMENTS,
    JumpResult,
    find_jumps,
    jump_by_degree,
    references,
)
from cam_rig.paper.noise import figures as noise_study_plot
from cam_rig.paper.noise.study import NoiseStudy, study_noise
from cam_rig.paper.orders import figures as orders_plot
from cam_rig.paper.orders.spectrum import CamOrders, waterfall
from cam_rig.paper.orders.steady_force import BUILDERS
from cam_rig.paper.orders.study import OrdersResult
from cam_rig.paper.readings.study import ReadingsResult, read_all
from cam_rig.paper.stem import figures as stem_plot
from cam_rig.paper.stem.chain import Stem
from cam_rig.paper.stem.study import STEM_RPM, StemStudy, study_stem
from cam_rig.paper.timing import figures as timing_plot
from cam_rig.paper.timing.study import TimingResult
from cam_rig.paper.vibration import figures as vibration_plot
from cam_rig.paper.vibration.study import LOWER, VIBRATION_RPM, VibrationResult, measure
from cam_rig.profile import figures as profile_plot
from cam_rig.profile.check_table import GUIDED, check_cam
from cam_rig.report.sections import Recorded, read_recorded
from cam_rig.schema import (
    CamConfig,
    Library,
    PublishedTables,
    RigConfig,
    TableReadings,
    load_readings,
    load_rig,
    load_tables,
)
from cam_rig.show.figure import strips, write_strip
from cam_rig.simulation.scene import LoadedScene, open_scene

#: Speed of the contact study, rpm, and the cams besides the paper's: other kinds of follower.
CONTACT_RPM, CONTACT_CAMS = 300.0, ("flat", "oscillating_flat", "point")

#: Cams that move their follower both ways.
FORM_CLOSED = ("constant_breadth", "constant_diameter", "conjugate", "oscillating_conjugate")

#: Roller and least radius of the contour in the nomogram, in lifts.
SHARPEST = 2.0

#: Highest order of the Campbell diagrams, whose rays stay apart on paper, and dots per inch of
#: their thousands of strokes, which are pixels within the SVG.
SHOWN_ORDERS, ORDERS_DPI = 40, 130

#: What a report computes, as progress is shown.
PARTS = ("jump speeds", "vibration", "figures", "noise", "continuity or slopes")


@dataclass(frozen=True)
class Sources:
    """Every file a report starts from, read and checked before anything runs.

    ``stiff`` is the rig of the noise study, whose stem is the paper's Table 1; ``touching`` the
    cams of the contact study, ``form_closed`` those that move their follower both ways.
    """

    cam_set: CamSet
    loaded: LoadedScene
    tables: PublishedTables
    factorial: FactorialConfig
    stiff: RigConfig
    recorded: Recorded | None
    readings: TableReadings
    touching: CamSet
    form_closed: list[tuple[CamConfig, Law]]


@dataclass(frozen=True, eq=False)
class Findings:
    """All experiments of a report.

    ``degrees`` are jump speeds (rpm) of the law by segments by the degree of its half-rises;
    ``stiff_vibration`` is on the stem of Table 1; ``cuts`` are cams as fig. 12 has them cut, by
    name, and ``cut_sizes`` that of `CUT` over its radii. ``timing`` are the events of each cam,
    ``control`` those of `CUT` alone, beside the B-spline of its lift and events. ``orders``
    are of the scene's sweep; ``designs`` are the best laws beside the paper's.
    """

    sources: Sources
    jumps: JumpResult
    readings: ReadingsResult
    degrees: dict[int, float]
    vibration: VibrationResult
    stiff_vibration: VibrationResult
    flywheel: FlywheelStudy | None
    stems: list[StemStudy]
    noise: NoiseStudy
    factorial: Factorial
    cuts: dict[str, AsCut]
    cut_sizes: list[AsCut]
    timing: TimingResult
    control: TimingResult | None
    contact: ContactResult
    play: list[PlayRow]
    orders: tuple[CamOrders, ...]
    designs: list[LawDesign]


def open_sources(scene: Path, rig: Path, factorial: str, bag: Path | None) -> Sources:
    """Read every file of a report.

    Parameters
    ----------
    scene : of the noise study; the other files are found beside it, or shipped
    rig : file of the rig of the jump speeds
    factorial : name of the factorial study
    bag : a recording of the scene to compare with
    """
    library = Library.beside(scene)
    tables = load_tables(library.path("published/tables", "paper"))
    loaded = open_scene(scene)
    cams = [library.path("cams", cam) for cam in tables.table_2_jump]
    cam_set = open_cam_set(cams, rig)
    TwoMassParameters.from_rig(cam_set.rig)  # refused now rather than later
    config = open_factorial(library.path("factorials", factorial))
    return Sources(
        cam_set=cam_set,
        loaded=loaded,
        tables=tables,
        factorial=config,
        stiff=load_rig(library.path("rigs", config.noise_rig)),
        recorded=None if bag is None else read_recorded(bag, loaded),
        readings=load_readings(library.path("published/readings", "table2")),
        touching=open_cam_set(
            [*cams, *(library.path("cams", cam) for cam in CONTACT_CAMS)],
            rig,
        ),
        form_closed=open_form_closed(library.path("cams", cam) for cam in FORM_CLOSED),
    )


def find(
    sources: Sources,
    pool: Executor,
    on_part: Callable[[str], None],
    meanwhile: Callable[[JumpResult, VibrationResult], None],
) -> Findings:
    """Run every experiment, the two long ones in processes of their own.

    Parameters
    ----------
    on_part : called with each of `PARTS` when it is done
    meanwhile : done with the jump speeds and the vibration while the long ones run
    """
    noise = pool.submit(_noise, sources)
    factorial = pool.submit(_factorial, sources)
    cam_set = sources.cam_set
    parameters = TwoMassParameters.from_rig(cam_set.rig)
    jumps = find_jumps(cam_set, references(cam_set, sources.tables))
    degrees = jump_by_degree(cam_set.cams[BY_SEGMENTS], parameters, FROM_REST)
    readings = read_all(sources.readings, cam_set.cams, sources.tables.table_2_jump)
    on_part(PARTS[0])
    vibration = measure(cam_set, VIBRATION_RPM)
    stiff = measure(CamSet(cam_set.cams, cam_set.laws, sources.stiff), VIBRATION_RPM)
    flywheel = study_flywheel(cam_set, FLYWHEEL_RPM)
    stems = [study_stem(cam_set, stem, STEM_RPM) for stem in _stems(sources)]
    on_part(PARTS[1])
    bench = CutBench.of(cam_set.rig, sources.loaded)
    cuts = cut_all(cam_set, bench)
    cut_sizes = over_sizes(cuts[CUT].drawn, bench, BASES, ROLLERS) if CUT in cuts else []
    timing = TimingResult.of((cam_set.cams[cam], law) for cam, law in cam_set.laws.items())
    control = _control(cam_set)
    contact = compare_contacts(sources.touching, CONTACT_RPM, GUIDED)
    play = find_play(sources.form_closed)
    designs = paper_designs(cam_set)
    meanwhile(jumps, vibration)
    on_part(PARTS[2])
    levels = noise.result()
    on_part(PARTS[3])
    effects = factorial.result()
    on_part(PARTS[4])
    return Findings(
        sources=sources,
        jumps=jumps,
        readings=readings,
        degrees=degrees,
        vibration=vibration,
        stiff_vibration=stiff,
        flywheel=flywheel,
        stems=stems,
        noise=levels,
        factorial=effects,
        cuts=cuts,
        cut_sizes=cut_sizes,
        timing=timing,
        control=control,
        contact=contact,
        play=play,
        orders=_orders(sources.loaded),
        designs=designs,
    )


def _orders(loaded: LoadedScene) -> tuple[CamOrders, ...]:
    """The scene's sweep by orders; nothing of a model that has no closed form."""
    scene = loaded.scene
    if scene.model not in BUILDERS:
        return ()
    return waterfall(loaded.laws, scene.model, loaded.rig, sorted(scene.program.speeds.si_list))


def _control(cam_set: CamSet) -> TimingResult | None:
    """`CUT` beside a B-spline, where it is there and one Bézier curve."""
    if CUT not in cam_set.cams:
        return None
    found = TimingResult.of([(cam_set.cams[CUT], cam_set.laws[CUT])])
    return found if found.control else None


def _stems(sources: Sources) -> tuple[float, float]:
    """Stiffness (N/m) of the stem on the rig of the jump speeds, and of that of Table 1."""
    rigs = sources.cam_set.rig, sources.stiff
    soft, stiff = (rig.need("stem_stiffness", "the report").si for rig in rigs)
    return soft, stiff


def _noise(sources: Sources) -> NoiseStudy:
    return study_noise(sources.loaded, sources.cam_set.rig)


def _factorial(sources: Sources) -> Factorial:
    bench = Bench.of(sources.factorial, sources.cam_set.rig, sources.stiff)
    return run_factorial(sources.factorial, bench, sources.cam_set.laws)


# The report's figures, drawn as SVG and carried in the page itself.

#: Speeds of the figures, rpm: below every jump speed, and above all but Bézier 15's.
STEADY_RPM, TAKEOFF_RPM = 300.0, 460.0

PROPOSED = "bezier15"


def uris(figure: Figure, dpi: float | None = None) -> list[str]:
    """A figure's strips as SVG, from the top, each a data URI that repeats bit for bit.

    ``dpi`` is of what is made of pixels.
    """
    found = []
    for low, high in strips(figure):
        with temporary_folder() as folder:
            path = folder / "figure.svg"
            try:
                write_strip(figure, low, high, path, dpi)
            except OSError as error:
                raise no_room(folder, error) from None
            text = path.read_text(encoding="utf-8")
        kept = [line for line in text.splitlines() if "<dc:date>" not in line]
        data = base64.b64encode("\n".join(kept).encode()).decode()
        found.append(f"data:image/svg+xml;base64,{data}")
    return found


def early_figures(
    sources: Sources, jumps: JumpResult, vibration: VibrationResult
) -> dict[str, list[str]]:
    """Those that wait for no long study: URIs by key."""
    cam_set, arcs = sources.cam_set, _arc_cam(sources)
    cam, law = cam_set.cams[PROPOSED], cam_set.laws[PROPOSED]
    tm21, tm21_law = sources.loaded.cams[arcs], sources.loaded.laws[arcs]
    checks = check_cam(cam, law)
    shown = [(cam_set.cams[name], curve) for name, curve in cam_set.laws.items()]
    return {
        "rises": uris(law_figures.rises_figure(families().values())),
        "cams": uris(law_figures.cams_figure(shown)),
        "fig1": uris(law_figures.figure(tm21, tm21_law)),
        "fig2": uris(law_figures.figure(cam, law)),
        "fig4": uris(vibration_plot.figure(vibration, STEADY_RPM)),
        "fig11": uris(jump_plot.lift_off_figure(cam_set, TAKEOFF_RPM)),
        "profile": uris(profile_plot.figure(cam, law, checks)),
        "jump": uris(jump_plot.figure(jumps)),
    }


def late_figures(found: Findings) -> dict[str, list[str]]:
    """Those of the studies."""
    sources, noise, factorial = found.sources, found.noise, found.factorial
    return {
        "contact": uris(contact_plot.figure(found.contact)),
        "events": uris(contact_plot.events_figure(GUIDED, SHARPEST)),
        "fig16": uris(noise_study_plot.figure(noise, sources.loaded)),
        "factorial": uris(factorial_plot.figure(factorial)),
    }


def flywheel_figures(found: Findings) -> dict[str, list[str]]:
    """That of the flywheel; none for a rig without a shaft."""
    study, titles = found.flywheel, found.sources.cam_set.titles
    if study is None:
        return {}
    return {"flywheel": uris(flywheel_module.flywheel_figure(study, titles))}


def stem_figures(found: Findings) -> dict[str, list[str]]:
    """That of the stem in more and more masses."""
    cam_set = found.sources.cam_set
    stem = Stem(TwoMassParameters.from_rig(cam_set.rig), 1.0)
    law, title = cam_set.laws[LOWER], cam_set.titles[LOWER]
    return {"stem": uris(stem_plot.stem_figure(law, title, stem))}


def cut_figures(found: Findings) -> dict[str, list[str]]:
    """Fig. 12, where its cam has a roller."""
    cut, titles = found.cuts.get(CUT), found.sources.cam_set.titles
    if cut is None:
        return {}
    return {"fig12": uris(as_cut_plot.figure(cut, titles[CUT]))}


def timing_figures(found: Findings) -> dict[str, list[str]]:
    """What the ordinates move, where a cam is one Bézier curve."""
    return {} if found.control is None else {"timing": uris(timing_plot.figure(found.control))}


def order_figures(found: Findings) -> dict[str, list[str]]:
    """Orders over speed, where the scene's model has them."""
    if not found.orders:
        return {}
    shown = tuple(study.up_to(SHOWN_ORDERS) for study in found.orders)
    result = OrdersResult(shown, found.sources.loaded.titles)
    return {"orders": uris(orders_plot.figure(result), ORDERS_DPI)}


def _arc_cam(sources: Sources) -> str:
    """The scene's identified cam, which stands in for the TM21's own."""
    loaded = sources.loaded
    return next(cam for cam in loaded.cams if loaded.part(cam) == "identified")
