// The drawings on three canvases: the body in space, the polhode in the body, and the herpolhode in
// the invariable plane. The drawing is a perspective of lines and faces; faces that are farther away
// are drawn first.
import { inSpace } from "./closed-form.js";

const DISTANCE = 5; // of the eye, in units of the drawing
const ELEVATION = 0.3; // of the eye, rad
const PATH = 720; // points of the polhode
const TRACE = 1200; // most points of the herpolhode
const STEP = 0.15; // rad that the body turns between points of the herpolhode
const COLOURS = ["--ink", "--paper", "--line", "--muted", "--accent", "--c1", "--c2", "--c3"];

export class Drawing {
  // `canvases` are { space, body, plane }.
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
    const { omega, attitude } = motion.at(0);
    const momentum = inSpace(attitude, omega.map((x, i) => moments[i] * x));
    const size = Math.hypot(...momentum);
    const energy = omega.reduce((sum, x, i) => sum + moments[i] * x * x, 0);
    const path = Array.from({ length: PATH + 1 }, (_, n) => {
      return motion.at(motion.span * (n / PATH - (motion.flipTime < Infinity ? 0 : 0.5))).omega;
    });
    const most = Math.max(...path.map((w) => Math.hypot(...w))) || 1;
    // The shortest rotation of the angular momentum to the vertical.
    const [x, y, z] = momentum.map((each) => (size > 0 ? each / size : 0));
    const half = Math.sqrt((1 + z) / 2);
    const upright =
      size === 0 ? [1, 0, 0, 0]
      : half < 1e-9 ? [0, 1, 0, 0]
      : [half, y / (2 * half), -x / (2 * half), 0]; // prettier-ignore
    const [a, b, c] = moments;
    const squares = [b + c - a, c + a - b, a + b - c].map((each) => Math.max(0, each));
    const edges = squares.map((each) => Math.sqrt(each / Math.max(...squares)));
    this.motion = {
      ...{ motion, moments, path, most, upright },
      height: size > 0 ? energy / size / most : 0,
      radii: moments.map((moment) => Math.sqrt(energy / moment)),
      box: edges.map((each) => Math.max(0.03, 0.6 * each)),
    };
  }

  // Draw the state at a time (s), seen from an angle (rad) around the vertical.
  draw(time, azimuth) {
    const { motion, most, upright } = this.motion;
    const state = motion.at(time);
    const place = (q, vector) => inSpace(upright, inSpace(q, vector));
    const step = STEP / most;
    const first = Math.max(0, Math.floor(time / step) - TRACE);
    const trace = [];
    for (let n = first; n * step < time; n++) {
      const { omega, attitude } = motion.at(n * step);
      trace.push(place(attitude, omega).map((x) => x / most));
    }
    trace.push(place(state.attitude, state.omega).map((x) => x / most));
    this.drawSpace(state, trace, azimuth, place);
    this.drawBody(state, azimuth);
    this.drawPlane(trace);
  }

  drawSpace(state, trace, azimuth, place) {
    const pen = this.pen("space", azimuth, 2.75, 0.14);
    const { height, box } = this.motion;
    const tip = trace.at(-1);
    const axes = [0, 1, 2].map((axis) => {
      const end = [0, 0, 0];
      end[axis] = box[axis] + 0.25;
      return { end: place(state.attitude, end), colour: `--c${axis + 1}`, name: String(axis + 1) };
    });
    const isFar = (end) => pen.depth(end) < 0;
    const arrows = [
      ...axes,
      { end: tip, colour: "--ink", name: "ω", wide: 3 },
      { end: [0, 0, 1.25], colour: "--accent", name: "L", wide: 3 },
    ];
    for (const each of arrows.filter(({ end }) => isFar(end))) pen.arrow(each);
    this.drawBox(pen, (corner) => place(state.attitude, corner));
    const reach = Math.max(0.2, ...trace.map(([x, y]) => 1.15 * Math.hypot(x, y)));
    const disc = circle((c, s) => [reach * c, reach * s, height]);
    pen.line(disc, { colour: "--muted", fill: "--line", alpha: 0.35 });
    pen.line(disc, { colour: "--muted" });
    pen.line(trace, { colour: "--ink", wide: 1.5 });
    for (const each of arrows.filter(({ end }) => !isFar(end))) pen.arrow(each);
    pen.dot(tip, "--ink");
  }

  // Draw the box with the body's moments. Each pair of faces has the colour of its axis; the face
  // on the positive side is darker.
  drawBox(pen, place) {
    const { box } = this.motion;
    const faces = [0, 1, 2].flatMap((axis) =>
      [-1, 1].map((side) => {
        const [b, c] = [(axis + 1) % 3, (axis + 2) % 3];
        const corner = (p, q) => {
          const at = [0, 0, 0];
          [at[axis], at[b], at[c]] = [side * box[axis], p * box[b], q * box[c]];
          return place(at);
        };
        const around = [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)];
        const middle = around[0].map((x, i) => (x + around[2][i]) / 2);
        return { around, axis, side, depth: pen.depth(middle) };
      }),
    );
    for (const { around, axis, side } of faces.sort((p, q) => p.depth - q.depth)) {
      const closed = [...around, around[0]];
      pen.line(closed, { fill: "--paper" });
      const colour = `--c${axis + 1}`;
      pen.line(closed, { fill: colour, alpha: side > 0 ? 0.8 : 0.3 });
      pen.line(closed, { colour: "--ink" });
    }
  }

  drawBody(state, azimuth) {
    const pen = this.pen("body", azimuth + 0.6, 2.5, 0);
    const { moments, path, radii } = this.motion;
    const unit = Math.max(...radii) || 1;
    const scaled = (w) => w.map((x) => x / unit);
    // The outward normal of the ellipsoid is along I omega.
    const isNear = (w) => pen.depth(scaled(w.map((x, i) => moments[i] * x / Math.max(...moments)))) > 0;
    const curve = (points, style) => {
      for (const near of [false, true]) {
        for (let n = 1; n < points.length; n++) {
          if (isNear(points[n]) !== near) continue;
          const { wide = 1, alpha = 1 } = style;
          const faint = near ? alpha : 0.3 * alpha;
          pen.line([points[n - 1], points[n]].map(scaled), { ...style, wide, alpha: faint });
        }
      }
    };
    if (!(radii[0] > 0)) return;
    for (const axis of [0, 1, 2]) {
      const [b, c] = [(axis + 1) % 3, (axis + 2) % 3];
      const section = circle((x, y) => {
        const at = [0, 0, 0];
        [at[b], at[c]] = [radii[b] * x, radii[c] * y];
        return at;
      });
      curve(section, { colour: "--muted" });
      const end = [0, 0, 0];
      end[axis] = radii[axis] / unit;
      const beyond = end.map((x) => 1.18 * x);
      pen.line([end, beyond], { colour: `--c${axis + 1}`, wide: 2 });
      pen.text(end.map((x) => 1.3 * x), String(axis + 1), `--c${axis + 1}`);
    }
    for (const each of separatrix(moments, radii)) curve(each, { colour: "--c2", alpha: 0.8 });
    curve(path, { colour: "--ink", wide: 2.5 });
    pen.dot(scaled(state.omega), "--ink");
  }

  drawPlane(trace) {
    const reach = Math.max(1e-9, ...trace.map(([x, y]) => Math.hypot(x, y)));
    const pen = this.pen("plane", 0, 2.4, 0, Math.PI / 2, 1e6);
    const flat = trace.map(([x, y]) => [x / reach, y / reach, 0]);
    pen.line([[-0.05, 0, 0], [0.05, 0, 0]], { colour: "--accent" }); // prettier-ignore
    pen.line([[0, -0.05, 0], [0, 0.05, 0]], { colour: "--accent" }); // prettier-ignore
    pen.text([0.09, -0.09, 0], "L", "--accent");
    pen.line(flat, { colour: "--ink" });
    pen.dot(flat.at(-1), "--ink");
  }

  // Clear a canvas and return the functions that draw in it. `across` is the height of the canvas
  // in units of the drawing, and `down` moves the origin.
  pen(name, azimuth, across, down, elevation = ELEVATION, distance = DISTANCE) {
    const canvas = this.canvases[name];
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const [columns, rows] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (canvas.width !== columns) canvas.width = columns;
    if (canvas.height !== rows) canvas.height = rows;
    const c = canvas.getContext("2d");
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.clearRect(0, 0, width, height);
    c.lineJoin = "round";
    c.font = "600 14px sans-serif";
    c.textAlign = "center";
    c.textBaseline = "middle";
    const [ca, sa, ce, se] = [azimuth, elevation].flatMap((x) => [Math.cos(x), Math.sin(x)]);
    const scale = Math.min(width, height) / across;
    const depth = ([x, y, z]) => z * se - (x * sa + y * ca) * ce;
    const at = (v) => {
      const [x, y, z] = v;
      const near = distance / (distance - depth(v));
      const up = z * ce + (x * sa + y * ca) * se;
      return [
        width / 2 + scale * near * (x * ca - y * sa),
        height * (0.5 + down) - scale * near * up,
      ];
    };
    const colours = this.colours;
    const line = (points, { colour, fill, wide = 1, alpha = 1 }) => {
      c.globalAlpha = alpha;
      c.beginPath();
      for (const point of points) c.lineTo(...at(point));
      if (fill) {
        c.fillStyle = colours[fill];
        c.fill();
      } else {
        c.strokeStyle = colours[colour];
        c.lineWidth = wide;
        c.stroke();
      }
      c.globalAlpha = 1;
    };
    const text = (point, words, colour) => {
      c.fillStyle = colours[colour];
      c.fillText(words, ...at(point));
    };
    const dot = (point, colour) => {
      c.fillStyle = colours[colour];
      c.beginPath();
      c.arc(...at(point), 4, 0, 7);
      c.fill();
    };
    const arrow = ({ end, colour, name: words, wide = 2 }) => {
      line([[0, 0, 0], end], { colour, wide });
      const [from, to] = [at([0, 0, 0]), at(end)];
      const length = Math.hypot(to[0] - from[0], to[1] - from[1]) || 1;
      const [x, y] = [(to[0] - from[0]) / length, (to[1] - from[1]) / length];
      c.fillStyle = colours[colour];
      c.beginPath();
      c.moveTo(to[0] + 6 * x, to[1] + 6 * y);
      c.lineTo(to[0] - 5 * x - 4 * y, to[1] - 5 * y + 4 * x);
      c.lineTo(to[0] - 5 * x + 4 * y, to[1] - 5 * y - 4 * x);
      c.fill();
      c.fillText(words, to[0] + 16 * x, to[1] + 16 * y);
    };
    return { depth, line, text, dot, arrow };
  }
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
  const [low, middle, high] = [0, 1, 2].sort((a, b) => moments[a] - moments[b]);
  const [lower, upper] = [moments[middle] - moments[low], moments[high] - moments[middle]];
  if (!(lower > 0 && upper > 0)) return [];
  const share = upper / (lower + upper);
  return [-1, 1].map((side) =>
    circle((x, y) => {
      const at = [0, 0, 0];
      at[middle] = radii[middle] * y;
      at[low] = radii[low] * Math.sqrt(share) * x;
      at[high] = side * radii[high] * Math.sqrt(1 - share) * x;
      return at;
    }),
  );
}
