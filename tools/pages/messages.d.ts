// What the server tells the pages, and what more than one of their modules speaks of.

/** From and to, or x and y. */
type Pair = [number, number];
/** All x, and all y, of points. */
type Points = [number[], number[]];
type Numbers = Float64Array | Float32Array | number[];

// -- the cam and its follower -----------------------------------------------------------------

/** A contour in mm; `undercut` and `steep` are indices of points. */
interface Disc {
  points: Points;
  pitch: Points | null;
  undercut: number[];
  steep: number[];
}

/** The cam in its own frame, the follower about its origin and how it moves; mm and rad. */
interface CamPicture {
  contour: Points;
  base: number;
  roller: number;
  outline: Points[];
  support: Points[];
  origin: Pair;
  along: Pair;
  turn: number;
  turns: number;
  place: Points;
  swings: boolean;
  reach: number;
  max_lift: number;
  touch: Points;
  normal: Points;
}

/** Cam angle (rad), lift (mm), contact force (N) and gap (µm, 0 in contact). */
interface Pose {
  angle: number;
  lift: number;
  force: number;
  gap: number;
}

// -- the board --------------------------------------------------------------------------------

/** One ordinate that may be moved. */
interface SentHandle {
  index: number;
  angle: number;
  segment: number;
  left: number;
  right: number;
}

/** With the angle's index, which the page adds. */
interface Handle extends SentHandle {
  k: number;
}

interface Board {
  cam: { name: string; lift_m: number; sprung: boolean };
  drawn_as: { degree: number; exact: boolean } | null;
  distance_m: number;
  start_made: boolean;
  follower: { roller_mm: number; pivot_mm: number | null };
  picture: CamPicture;
  rig: Mass & { name: string; two_masses: boolean; from_rest_s: number; calibrated_on: string };
  rpm: number;
  rpm_range: Pair;
  version: number;
  ordinates: number[];
  start: number[];
  handles: SentHandle[];
  cams: string[];
  points: number;
  orders: number;
  /** Arrays in base64. */
  first: string;
  table: string;
  constant: string;
  colours: Record<string, string>;
}

/** One mass on a spring, SI. */
interface Mass {
  mass: number;
  damping: number;
  spring_stiffness: number;
  preload: number;
}

/** A value or why there is none; nothing is none at any speed. */
interface Found {
  value?: number;
  words?: string;
}

/** What a law cannot be made for, or should not: at an angle, or in words alone. */
type Fault =
  | { key: "error"; words: string }
  | { key: "undercut" | "pressure"; angle_deg: number; value_deg?: number; allowed_deg?: number };

/** What ordinates come to, at once. */
interface Exact {
  type: "exact";
  number: number;
  version: number;
  discs: Disc[];
  faults: Fault[];
  warnings: Fault[];
  jump_rigid: Found;
  /** The greatest, of the disc on which it is nearest to its limit. */
  pressure: { value_deg: number; allowed_deg: number } | null;
}

/** Another page's ordinates, with what they come to. */
interface Moved extends Omit<Exact, "type" | "number"> {
  type: "moved";
  number: null;
  ordinates: number[];
  rpm: number;
}

/** What is found once the law rests, or why it is not. */
interface Rest {
  type: "rest";
  number?: undefined;
  version: number;
  rpm: number;
  words?: string;
  jump: Found;
  residual_um: Found;
  level_db: Found;
  file_jump?: Found;
  checks: string[];
  made: boolean;
}

/** A better law so far, the last one and its file, or why there is none. */
interface Design {
  type: "design";
  number?: undefined;
  so_far_rpm?: number;
  rpm: number;
  path: string;
  motion: string;
  words?: string;
  stopped?: boolean;
}

interface Refused {
  type: "refused";
  number: number;
  words: string;
}

/** Another page has opened a file. */
interface Opened {
  type: "opened";
  number?: undefined;
}

type BoardMessage = Exact | Moved | Rest | Design | Refused | Opened;

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

/** The bench as a page sees it: all of it at first, then what has changed. */
interface Live {
  type: "live";
  holds: boolean;
  sound_rate: number;
  calibrated_on: string;
  setup: Setup;
  graph: string;
  words: string;
  domain: number;
  drive: string;
  waits_for: string;
  /** What the nodes are set to, by their names. */
  values: Record<string, any>;
  /** Empty until the cam has turned. */
  state: { cam: string; rpm: number } | Record<string, never>;
  contact: string;
  late: string;
  kept: string[];
  log: string[];
  readings: NotedReading[];
  screen: string;
  losses: number;
  level: number | null;
}

/** `answer` is the number of what was asked, null where it had none. */
interface SentAnswer extends Answer {
  type: "answer";
  answer: number | null;
}

interface Answer {
  success: boolean;
  words: string;
  noted?: NotedReading;
}

/** A settled turn; `curves` are its rows in base64. */
interface Expected {
  curves: string;
  rpm: number;
  lost: boolean;
  settled: boolean;
  least_n: number;
  level_db: number | null;
  jumps: { model: string; rpm: number | null }[];
}

// -- the lab ----------------------------------------------------------------------------------

/** A row of a sheet: a reading, with where it is in the plot, or an answer. */
interface LabReading {
  number: number;
  spring_stiffness: number | null;
  added_mass: number | null;
  preload: number | null;
  cam: string | null;
  rpm: number | null;
  measured: number | null;
  answer: number | null;
  point?: { x: number; y: number; marker: number; full: boolean };
}

interface LabSheet {
  lab: string;
  cams: string[];
  rig: { name: string; spring_stiffness: number; mass: number; preload: number };
  seed: string | null;
  tolerances: Record<string, number> | null;
  /** What can be set up, by the names of a reading. */
  options: Record<string, (number | string)[]>;
  marker: string;
  lift: number | null;
  scatter_db: number | null;
  measured: boolean;
  answered: boolean;
  heard: boolean;
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
