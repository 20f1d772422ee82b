// The drawings on three canvases: the body in space, the polhode in the body, and the herpolhode in
// the invariable plane. They are perspectives of lines and faces; what is farther away is drawn first.
import { inSpace } from "./closed-form.js";

// The distance of the eye, in units of the drawing.
const DISTANCE = 5;
// The elevation of the eye, rad.
const ELEVATION = 0.3;
// The number of points of the polhode.
const PATH = 720;
// The most points of the herpolhode.
const TRACE = 1200;
// The angle (rad) by which the body turns between points of the herpolhode.
const STEP = 0.15;
const AXES = [0, 1, 2];
const AXIS_COLOURS = ["--c1", "--c2", "--c3"];
const COLOURS = ["--ink", "--paper", "--line", "--muted", "--accent", ...AXIS_COLOURS];

export class Drawing {
  // `canvases` are { space, polhode, herpolhode }.
  constructor(canvases) {
    this.canvases = canvases;
    this.recolour();
  }

  // Read the colours that apply now; only the computed style of an element shows them.
  recolour() {
    const probe = document.createElement("span");
    document.body.append(probe);
    this.colours = {};
    for (const name of COLOURS) {
      probe.style.color = `var(${name})`;
      this.colours[name] = getComputedStyle(probe).color;
    }
    probe.remove();
  }

  // Set the motion to draw, with its moments (kg m2).
  setMotion(motion, moments) {
    const { omega } = motion.at(0);
    const momentum = omega.map((x, i) => moments[i] * x);
    const size = Math.hypot(...momentum);
    const energy = omega.reduce((sum, x, i) => sum + momentum[i] * x, 0);
    const begin = motion.flipTime < Infinity ? 0 : -0.5;
    const path = Array.from({ length: PATH + 1 }, (_, n) => {
      return motion.at(motion.span * (n / PATH + begin)).omega;
    });
    const most = Math.max(...path.map((w) => Math.hypot(...w))) || 1;
    // The shortest rotation of the angular momentum to the vertical.
    const [x, y, z] = momentum.map((each) => each / (size || 1));
    const norm = Math.hypot(1 + z, x, y);
    const upright = norm > 1e-9 ? [1 + z, y, -x, 0].map((each) => each / norm) : [0, 1, 0, 0];
    const sum = moments[0] + moments[1] + moments[2];
    const edges = moments.map((moment) => Math.sqrt(Math.max(0, sum - 2 * moment)));
    this.motion = {
      ...{ motion, moments, path, most, upright, size },
      height: energy / (size || 1) / most,
      radii: moments.map((moment) => Math.sqrt(energy / moment)),
      box: edges.map((edge) => Math.max(0.03, (0.85 * edge) / Math.hypot(...edges))),
    };
  }

  // Draw the state at a time (s), seen from an angle (rad) around the vertical.
  draw(time, azimuth) {
    const { motion, most, upright } = this.motion;
    const state = motion.at(time);
    const tip = ({ omega, attitude }) =>
      inSpace(upright, inSpace(attitude, omega)).map((x) => x / most);
    const step = STEP / most;
    const trace = [];
    for (let n = Math.max(0, Math.floor(time / step) - TRACE); n * step < time; n++) {
      trace.push(tip(motion.at(n * step)));
    }
    trace.push(tip(state));
    this.drawSpace(state, trace, azimuth);
    this.drawBody(state, azimuth);
    this.drawPlane(trace);
  }

  drawSpace({ omega, attitude }, trace, azimuth) {
    const pen = this.pen("space", azimuth, 2.55, 0.1);
    const { moments, most, upright, size, height, box } = this.motion;
    const place = (v) => inSpace(upright, inSpace(attitude, v));
    // An arrow begins where it leaves the box. It is behind the box if this face is not seen.
    const arrow = (v, colour, name, wide) => {
      const shares = AXES.map((axis) => Math.abs(v[axis]) / box[axis]);
      const axis = shares.indexOf(Math.max(...shares));
      const from = place(v.map((x) => x / shares[axis]));
      const isNear = pen.depth(place(vector({ [axis]: v[axis] }))) > 0;
      return { from, to: place(v), colour, name, wide, isNear };
    };
    const arrows = AXES.map((axis) =>
      arrow(vector({ [axis]: box[axis] + 0.3 }), AXIS_COLOURS[axis], axis + 1, 2),
    );
    if (size > 0) {
      arrows.push(arrow(omega.map((x) => x / most), "--ink", "ω", 3));
      arrows.push(arrow(omega.map((x, i) => (1.25 * moments[i] * x) / size), "--accent", "L", 3));
    }
    for (const each of arrows) if (!each.isNear) pen.arrow(each);
    this.drawBox(pen, place);
    const reach = Math.max(0.2, ...trace.map(([x, y]) => 1.15 * Math.hypot(x, y)));
    const disc = circle((c, s) => [reach * c, reach * s, height]);
    pen.line(disc, { fill: "--line", alpha: 0.35 });
    pen.line(disc, { colour: "--muted" });
    pen.line(trace, { colour: "--ink", wide: 1.5 });
    for (const each of arrows) if (each.isNear) pen.arrow(each);
    pen.dot(trace.at(-1));
  }

  // Draw the box with the body's moments. Each pair of faces has the colour of its axis; the face
  // on the positive side is darker.
  drawBox(pen, place) {
    const { box } = this.motion;
    const faces = AXES.flatMap((axis) =>
      [-1, 1].map((side) => {
        const [b, c] = [(axis + 1) % 3, (axis + 2) % 3];
        const corner = (p, q) =>
          place(vector({ [axis]: side * box[axis], [b]: p * box[b], [c]: q * box[c] }));
        const around = [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1), corner(-1, -1)];
        return { around, axis, side, depth: pen.depth(around[0]) + pen.depth(around[2]) };
      }),
    );
    for (const { around, axis, side } of faces.sort((p, q) => p.depth - q.depth)) {
      pen.line(around, { fill: "--paper" });
      pen.line(around, { fill: AXIS_COLOURS[axis], alpha: side > 0 ? 0.8 : 0.3 });
      pen.line(around, { colour: "--ink" });
    }
  }

  drawBody({ omega }, azimuth) {
    const { moments, path, radii } = this.motion;
    const unit = Math.max(...radii) || 1;
    // The longest axis is not to point to the eye.
    const pen = this.pen("polhode", azimuth + (radii[1] > radii[0] ? Math.PI / 2 : 0), 2.9, 0, 0.6);
    const scaled = (w) => w.map((x) => x / unit);
    // What is behind the ellipsoid is faint. Its outward normal is along I omega.
    const curve = (points, style, stride = 1) => {
      for (let n = 1; n < points.length; n += stride) {
        const alpha = pen.depth(points[n].map((x, i) => moments[i] * x)) > 0 ? 1 : 0.3;
        pen.line([scaled(points[n - 1]), scaled(points[n])], { ...style, alpha });
      }
    };
    for (const axis of AXES) {
      const [b, c] = [(axis + 1) % 3, (axis + 2) % 3];
      const along = (x) => vector({ [axis]: (x * radii[axis]) / unit });
      curve(circle((x, y) => vector({ [b]: radii[b] * x, [c]: radii[c] * y })), { colour: "--muted" });
      const colour = AXIS_COLOURS[axis];
      pen.arrow({ from: along(1), to: along(1.12), colour, name: axis + 1, wide: 2 });
    }
    for (const each of separatrix(moments, radii)) curve(each, { colour: "--accent" }, 2);
    curve(path, { colour: "--ink", wide: 2.5 });
    pen.dot(scaled(omega));
  }

  drawPlane(trace) {
    const pen = this.pen("herpolhode", 0, 2.4, 0, Math.PI / 2, 1e6);
    const reach = Math.max(1e-9, ...trace.map(([x, y]) => Math.hypot(x, y)));
    const flat = trace.map(([x, y]) => [x / reach, y / reach, 0]);
    pen.line(flat, { colour: "--ink" });
    pen.dot([0, 0, 0], "--accent", "L");
    pen.dot(flat.at(-1));
  }

  // Clear a canvas and return the functions that draw in it. `across` is the smaller side of the
  // canvas in units of the drawing, and `down` moves the origin.
  pen(name, azimuth, across, down, elevation = ELEVATION, distance = DISTANCE) {
    const { colours } = this;
    const canvas = this.canvases[name];
    const { clientWidth: width, clientHeight: height } = canvas;
    const ratio = window.devicePixelRatio || 1;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    const c = canvas.getContext("2d");
    c.scale(ratio, ratio);
    c.font = "600 14px sans-serif";
    c.textAlign = "center";
    c.textBaseline = "middle";
    const [ca, sa, ce, se] = [azimuth, elevation].flatMap((x) => [Math.cos(x), Math.sin(x)]);
    const depth = ([x, y, z]) => z * se - (x * sa + y * ca) * ce;
    const at = (v) => {
      const [x, y, z] = v;
      const scale = (Math.min(width, height) / across) * (distance / (distance - depth(v)));
      const up = z * ce + (x * sa + y * ca) * se;
      return [width / 2 + scale * (x * ca - y * sa), height * (0.5 + down) - scale * up];
    };
    const line = (points, { colour, fill, wide = 1, alpha = 1 }) => {
      c.globalAlpha = alpha;
      c.fillStyle = colours[fill];
      c.strokeStyle = colours[colour];
      c.lineWidth = wide;
      c.beginPath();
      for (const point of points) c.lineTo(...at(point));
      if (fill) c.fill();
      else c.stroke();
      c.globalAlpha = 1;
    };
    const dot = (point, colour = "--ink", words = "") => {
      const [x, y] = at(point);
      c.fillStyle = colours[colour];
      c.beginPath();
      c.arc(x, y, 4, 0, 7);
      c.fill();
      c.fillText(words, x, y + 14);
    };
    const arrow = ({ from, to, colour, name: words, wide }) => {
      line([from, to], { colour, wide });
      const [[x0, y0], [x1, y1]] = [at(from), at(to)];
      const length = Math.hypot(x1 - x0, y1 - y0) || 1;
      const [x, y] = [(x1 - x0) / length, (y1 - y0) / length];
      c.fillStyle = colours[colour];
      c.beginPath();
      c.moveTo(x1 + 6 * x, y1 + 6 * y);
      c.lineTo(x1 - 5 * x - 4 * y, y1 - 5 * y + 4 * x);
      c.lineTo(x1 - 5 * x + 4 * y, y1 - 5 * y - 4 * x);
      c.fill();
      c.fillText(words, x1 + 16 * x, y1 + 16 * y);
    };
    return { depth, line, dot, arrow };
  }
}

function vector(components) {
  return AXES.map((axis) => components[axis] ?? 0);
}

function circle(point) {
  return Array.from({ length: 73 }, (_, n) => {
    const angle = (n * Math.PI) / 36;
    return point(Math.cos(angle), Math.sin(angle));
  });
}

// Return the two curves that part the polhodes about the axes of the smallest and of the largest
// moment. They are plane, and pass through the middle axis.
function separatrix(moments, radii) {
  const [low, middle, high] = [...AXES].sort((a, b) => moments[a] - moments[b]);
  const share = (moments[high] - moments[middle]) / (moments[high] - moments[low]);
  if (!(share > 0 && share < 1)) return [];
  return [-1, 1].map((side) =>
    circle((x, y) =>
      vector({
        [middle]: radii[middle] * y,
        [low]: radii[low] * Math.sqrt(share) * x,
        [high]: side * radii[high] * Math.sqrt(1 - share) * x,
      }),
    ),
  );
}
