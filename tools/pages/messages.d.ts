// Messages that the server sends to the pages, and types that several modules share.

/** Lowest and highest value, or x and y. */
type Pair = [number, number];
/** Coordinates x and y of points. */
type Points = [number[], number[]];
type Numbers = Float64Array | Float32Array | readonly number[];

// -- the cam and its follower -----------------------------------------------------------------

/** A contour in mm. `undercut` and `steep` are indices of points. */
interface Disc {
  points: Points;
  pitch: Points | null;
  undercut: number[];
  steep: number[];
}

/** Base circle, and follower about its origin, in mm and rad. Origin and turn are linear in the lift. */
interface FollowerPicture {
  base: number;
  outline: Points[];
  origin: Pair;
  origin_per_mm: Pair;
  turn: number;
  turn_per_mm: number;
  is_oscillating: boolean;
  max_lift: number;
}

/** Cam in its frame with its follower, in mm and rad. */
interface CamPicture extends FollowerPicture {
  contour: Points;
  roller: number;
  support: Points[];
  /** Roller's centre, point or middle of the face, at zero and at the largest lift. */
  centre: Points;
  reach: number;
  contact: Points;
  normal: Points;
}

/** Cam angle (rad), lift (mm), contact force (N), and gap (µm, 0 in contact). */
interface Pose {
  angle: number;
  lift: number;
  force: number;
  gap: number;
}

// -- the board --------------------------------------------------------------------------------

/** Ordinate that may be moved. */
interface SentHandle {
  index: number;
  angle: number;
  segment: number;
  left: number;
  right: number;
}

/** Handle with the index of its angle in the motion table. */
interface Handle extends SentHandle {
  k: number;
}

interface Board {
  cam: { name: string; title: string; lift_m: number; sprung: boolean };
  /** B-splines that replace the law of the file, null if its ordinates are drawn. */
  b_splines: { degree: number; exact: boolean; distance_m: number } | null;
  start_can_be_made: boolean;
  /** Number of cams and rigs that have been opened or chosen. */
  generation: number;
  base_radius_mm: number;
  base_radius_range: Pair;
  rig: Bouncer & {
    name: string;
    title: string;
    two_masses: boolean;
    from_rest_s: number;
    has_shaft: boolean;
    has_flywheel: boolean;
    calibrated_on: string;
  };
  rpm: number;
  rpm_range: Pair;
  ordinates: number[];
  start: number[];
  start_base_radius_mm: number;
  handles: SentHandle[];
  /** Titles by name. */
  cams: Record<string, string>;
  rigs: Record<string, string>;
  law: BoardLaw;
  colours: Record<string, string>;
}

/** One mass on a spring, SI units. */
interface Mass {
  mass: number;
  damping: number;
  spring_stiffness: number;
  preload: number;
}

/** One mass with Newton's coefficient of restitution, null if the rig does not contain it. */
interface Bouncer extends Mass {
  restitution: number | null;
}

/** Sizes of a follower (m, rad). Sizes that its type does not have are 0, or null for a default. */
interface FollowerSizes {
  type: string;
  base_radius: number;
  roller_radius: number;
  eccentricity: number;
  inclination: number;
  arm: number;
  pivot_distance: number;
  face_offset: number;
  roller_distance: number | null;
  arms_angle: number | null;
  allowed_pressure: number;
}

/** Law: breaks (rad), and Bernstein ordinates (m) of each piece. */
interface LawData {
  name: string;
  breaks: number[];
  ordinates: number[][];
}

/** Rise of a cam: start and span (rad), and height (m). */
interface Rise {
  start: number;
  span: number;
  height: number;
}

/** Data of a cam for the core: sizes of its follower, the follower's picture at the start, and the highest rise. */
interface StaticCam {
  follower: FollowerSizes;
  picture: FollowerPicture;
  rise: Rise | null;
}

/** Fields of the board that the cam determines, the data for the core, and the law of the file for comparison. */
type CamData = Omit<Board, "rig" | "rigs" | "cams" | "rpm" | "rpm_range" | "colours"> & { static: StaticCam & { second: OtherLaw } };

/** Data in the file of the static board. The texts have the paths below /static. */
interface StaticData {
  languages: { language: string | null; languages: string[]; pages: string[] };
  texts: Record<string, Record<string, string>>;
  board: Pick<Board, "rigs" | "cams" | "rpm" | "rpm_range" | "colours">;
  cams: Record<string, CamData>;
  rigs: Record<string, Board["rig"]>;
  first: { cam: string; rig: string };
}

/** Polynomial pieces of a law: `matrices` times `count` ordinates from `first` on, or the constant `dwell` (m). */
interface BoardLaw {
  breaks: number[];
  degree: number;
  first: number[];
  count: number[];
  dwell: number[];
  /** Matrices of all pieces, row by row, in base64. */
  matrices: string;
}

/** A value, or the reason why there is none. Empty for infinity. */
interface PageValue {
  value?: number;
  message?: string;
}

/** Reason why a law cannot or should not be made, at an angle or as a message. */
type Fault =
  | { key: "error"; message: string }
  | { key: "undercut" | "pressure"; angle_deg: number; value_deg?: number; allowed_deg?: number };

/** Value of a derivative (m/rad^order) and its cam angle. */
interface Extreme {
  value: number;
  angle_deg: number;
}

/** Peaks of the first three derivatives of a law, and the class of its roughest joint. The coefficient is that of the rise. */
interface Figures {
  continuity: number;
  peaks: { largest: Extreme; least: Extreme; coefficient: number | null }[];
}

/** Law of another cam. */
interface OtherLaw {
  title: string;
  law: LawData;
  figures: Figures;
}

/** Results that are computed for each change. */
interface FastResults {
  version: number;
  figures: Figures;
  discs: Disc[];
  /** Null if the follower does not reach the cam. */
  follower: FollowerPicture | null;
  faults: Fault[];
  warnings: Fault[];
  jump_rigid: PageValue;
  /** Largest pressure angle of the disc on which it is nearest to its limit. */
  pressure: { value_deg: number; allowed_deg: number } | null;
}

/** Answer to a change of this page. */
interface Fast extends FastResults {
  type: "fast";
  number: number;
}

/** Change of another page. */
interface Changed extends FastResults {
  type: "changed";
  number: null;
  generation: number;
  ordinates: number[];
  rpm: number;
  base_radius_mm: number;
}

/** Check of the contour, with value and limit in its unit. A value of null is infinite. */
interface CheckResult {
  title: string;
  value: number | null;
  angle_deg: number | null;
  relation: "more than" | "less than" | "at most";
  limit: number;
  unit: string;
  passed: boolean;
  message: string;
}

/** Results that are computed after a pause in the changes. With a `message` there are no results. */
interface FullResults {
  type: "full";
  number?: undefined;
  version: number;
  rpm: number;
  message?: string;
  jump: PageValue;
  residual_um: PageValue;
  level_db: PageValue;
  /** Null for a rig without a shaft. */
  shaft: { twist_deg: PageValue; fluctuation_percent?: PageValue } | null;
  checks: CheckResult[];
  /** Reason why the cam cannot be checked, or empty. */
  check_error: string;
  can_be_made: boolean;
}

/** Best law of a running design, the result with its file, or the reason why there is none. */
interface Design {
  type: "design";
  number?: undefined;
  best_rpm?: number;
  rpm: number;
  path: string;
  law: OtherLaw;
  message?: string;
  stopped?: boolean;
}

interface Refused {
  type: "refused";
  number: number;
  message: string;
}

/** A file has been opened on a page. */
interface Opened {
  type: "opened";
  number?: undefined;
}

type BoardMessage = Fast | Changed | FullResults | Design | Refused | Opened;

// -- the bench --------------------------------------------------------------------------------

interface Setup {
  cam: string;
  rpm: number;
  model: string;
  added_mass: number;
  spring_stiffness: number;
  preload: number;
}

interface NotedReading {
  cam: string;
  model: string;
  rpm: number;
  level_db: number;
  weighting: string;
  contact: string;
  added_mass_kg: number;
  spring_stiffness_n_m: number;
  preload_n: number;
}

/** State of the bench: complete in the first message, then the changed values. */
interface Live {
  type: "live";
  has_controls: boolean;
  sound_rate: number;
  calibrated_on: string;
  setup: Setup;
  graph: string;
  failure: string;
  domain: number;
  drive: string;
  waits_for: string;
  /** Parameter values by node. */
  parameters: Record<string, any>;
  /** Empty before the first turn. */
  state: { cam: string; rpm: number } | Record<string, never>;
  contact: string;
  is_late: boolean;
  kept_bags: string[];
  log: string[];
  readings: NotedReading[];
  rerun_address: string;
  contact_losses: number;
  level: number | null;
}

/** Answer to the command of a number, null for a command without a number. */
interface SentAnswer extends Answer {
  type: "answer";
  answer: number | null;
}

interface Answer {
  success: boolean;
  message: string;
  reading?: NotedReading;
}

/** Predicted steady turn. `curves` are in base64. */
interface Expected {
  curves: string;
  rpm: number;
  contact_lost: boolean;
  is_steady: boolean;
  min_force_n: number;
  level_db: number | null;
  jumps: { model: string; rpm: number | null }[];
}

// -- the lab ----------------------------------------------------------------------------------

/** Row of a sheet: a reading with its position in the plot, or an answer. */
interface LabReading {
  number: number;
  spring_stiffness: number | null;
  added_mass: number | null;
  preload: number | null;
  cam: string | null;
  rpm: number | null;
  measured: number | null;
  answer: number | null;
  point?: { x: number; y: number; marker: number; is_filled: boolean };
}

interface LabSheet {
  lab: string;
  cams: string[];
  rig: { name: string; spring_stiffness: number; mass: number; preload: number };
  seed: string | null;
  tolerances: Record<string, number> | null;
  /** Values of the set-up by the names of a reading. */
  options: Record<string, (number | string)[]>;
  marker: string;
  critical_lift_m: number | null;
  scatter_db: number | null;
  has_instrument: boolean;
  has_answer: boolean;
  has_sound: boolean;
  /** True if the curve of a turn is the contact force. */
  shows_force: boolean;
  unit: string;
  knob: Pair;
  plot: { x: Pair; y: Pair };
  max_name: number;
  colours: string[];
  curve_colour: string;
  student: string;
  readings: LabReading[];
  file: string | null;
}
