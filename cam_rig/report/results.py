"""All findings of a report, and the jobs that compute them."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

from cam_rig.dynamics import TwoMassParameters
from cam_rig.laws import Law
from cam_rig.report.recorded import Recorded, read_recorded
from cam_rig.schema import (
    CamConfig,
    FactorialConfig,
    Library,
    PublishedTables,
    RigConfig,
    TableReadings,
    load_readings,
    load_rig,
    load_tables,
)
from cam_rig.simulation.loaded_scene import LoadedScene, open_scene
from cam_rig.studies.as_cut.comparison import AsCut, CutBench, cut_all, over_sizes
from cam_rig.studies.cam_set import CamSet, open_cam_set
from cam_rig.studies.contact.comparison import ContactTable, compare_contacts
from cam_rig.studies.contact.form_closed import PlayRow, find_play, open_form_closed
from cam_rig.studies.design.results.comparison import paper_designs
from cam_rig.studies.design.results.law_design import LawDesign
from cam_rig.studies.factorial.design import Factorial, run_factorial
from cam_rig.studies.factorial.laws import open_factorial
from cam_rig.studies.factorial.measures import Bench
from cam_rig.studies.flywheel.fluctuation import FlywheelStudy, study_flywheel
from cam_rig.studies.jump.comparison import JumpRow, find_jumps, jump_by_degree
from cam_rig.studies.jump.contact_lost_speed import FROM_REST
from cam_rig.studies.jump.published import references
from cam_rig.studies.jump.readings import Read, read
from cam_rig.studies.noise.run import NoiseStudy, study_noise
from cam_rig.studies.orders.steady_force import BUILDERS
from cam_rig.studies.orders.waterfall import CamOrders, waterfall
from cam_rig.studies.stem.comparison import StemStudy, study_stem
from cam_rig.studies.timing.comparison import CamTiming, EventControl, beside_b_spline
from cam_rig.studies.vibration.comparison import VibrationTable, vibration_table

#: Speeds of the vibration tables, rpm.
VIBRATION_RPM = (200.0, 250.0, 300.0, 350.0)
#: Speed of the flywheel's tables, rpm.
FLYWHEEL_RPM = 300.0
#: Speed at which stems are compared, rpm.
STEM_RPM = 300.0
#: Speed of the contact study, rpm, and the cams besides the paper's: other kinds of follower.
CONTACT_RPM, CONTACT_CAMS = 300.0, ("flat", "oscillating_flat", "point")
#: Cams that move their follower both ways.
FORM_CLOSED = ("constant_breadth", "constant_diameter", "conjugate", "oscillating_conjugate")
#: The paper's fifth law, whose degree it does not print.
BY_SEGMENTS = "bezier_segments"
#: The law that the paper cut a cam for (fig. 12), and radii (m) that it is cut with here.
CUT, BASES, ROLLERS = "bezier15", (0.050, 0.065, 0.100), (0.005, 0.010, 0.020)
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
    ``control`` `CUT` and the B-spline of its lift and events. ``orders`` are of the scene's sweep;
    ``designs`` are the best laws beside the paper's.
    """

    sources: Sources
    jumps: list[JumpRow]
    readings: list[Read]
    degrees: dict[int, float]
    vibration: VibrationTable
    stiff_vibration: VibrationTable
    flywheel: FlywheelStudy | None
    stems: list[StemStudy]
    noise: NoiseStudy
    factorial: Factorial
    cuts: dict[str, AsCut]
    cut_sizes: list[AsCut]
    timing: dict[str, CamTiming]
    control: list[EventControl]
    contact: ContactTable
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

    Raises
    ------
    ConfigError, LawError, BagError : a file that is missing or wrong, a bag of another scene
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
    meanwhile: Callable[[list[JumpRow]], None],
) -> Findings:
    """Run every experiment, the two long ones in processes of their own.

    Parameters
    ----------
    on_part : called with each of `PARTS` when it is done
    meanwhile : done with the jump speeds while the long ones run
    """
    noise = pool.submit(_noise, sources)
    factorial = pool.submit(_factorial, sources)
    cam_set = sources.cam_set
    parameters = TwoMassParameters.from_rig(cam_set.rig)
    jumps = find_jumps(cam_set.laws, parameters, references(cam_set, sources.tables), FROM_REST)
    degrees = jump_by_degree(cam_set.cams[BY_SEGMENTS], parameters, FROM_REST)
    readings = _readings(sources)
    on_part(PARTS[0])
    vibration = vibration_table(cam_set, VIBRATION_RPM)
    stiff = vibration_table(CamSet(cam_set.cams, cam_set.laws, sources.stiff), VIBRATION_RPM)
    flywheel = study_flywheel(cam_set, FLYWHEEL_RPM)
    stems = [study_stem(cam_set, stem, STEM_RPM) for stem in _stems(sources)]
    on_part(PARTS[1])
    bench = CutBench.of(cam_set.rig, sources.loaded)
    cuts = cut_all(cam_set, bench)
    cut_sizes = over_sizes(cuts[CUT].drawn, bench, BASES, ROLLERS) if CUT in cuts else []
    timing = {cam: CamTiming.of(cam_set.cams[cam], law) for cam, law in cam_set.laws.items()}
    control = beside_b_spline(timing[CUT]) if CUT in timing else []
    contact = compare_contacts(sources.touching, CONTACT_RPM)
    play = find_play(sources.form_closed)
    designs = paper_designs(cam_set)
    meanwhile(jumps)
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


def _readings(sources: Sources) -> list[Read]:
    known, printed = sources.readings, sources.tables.table_2_jump
    cams = sources.cam_set.cams
    return [read(name, one, cams, printed, known.run_s) for name, one in known.readings.items()]


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
