/** What the place makes of the bare map: the service's cells, made smooth for a sun that moves. */

import { angleBetween, clamp, direction, type Vector } from "../pure/angles";
import type { Triple } from "../sky/model";

/** By cells of equal angles, row by row from the zenith. */
export interface Factors {
  rows: number;
  columns: number;
  factors: Triple[];
}

/** Directions of the sun in the estimate and in the light on show. */
export interface Suns {
  before: Vector;
  now: Vector;
}

const GLOW = 40; // degrees around a sun within which the sky's brightness is the sun's
const MOVED = 20; // degrees by which a sun was moved for its glow to have gone

/** The upper cells under the estimate's sun. */
interface Glow {
  before: Vector;
  near: Float64Array; // of each cell, how much of its brightness is the sun's
  logs: Float64Array; // of its factors, three a cell
  means: Float64Array; // of the factors' logarithms beside the glow, three a row
}

/** The two cells beside a place, and how far the second counts. */
interface Between {
  low: number;
  high: number;
  share: number;
}

/** The factors of one photo for maps of `height` rows. What was computed last is kept: most steps ask for it again. */
export class PlaceFactors {
  private readonly down: Between[];
  private readonly across: Between[];
  private glow: Glow | undefined;
  private last: { moved: number; map: Float32Array } | undefined;

  constructor(
    private readonly cells: Factors,
    readonly height: number,
  ) {
    const { rows, columns } = cells;
    this.down = Array.from({ length: height }, (_, y) => {
      const first = y < height / 2 ? 0 : rows / 2;
      return between(((y + 0.5) * rows) / height, (row) => clamp(row, first, first + rows / 2 - 1));
    });
    this.across = Array.from({ length: 2 * height }, (_, x) =>
      between(((x + 0.5) * columns) / (2 * height), (column) => (column + columns) % columns),
    );
  }

  /** The factors of each pixel, three a pixel, linear between the cells' centres; not to be changed. */
  under({ before, now }: Suns): Float32Array {
    if (this.glow?.before.join() !== before.join()) {
      this.glow = glowOf(this.cells, before);
      this.last = undefined;
    }
    const moved = 1 - Math.exp(-((angleBetween(before, now) / MOVED) ** 2));
    if (this.last?.moved !== moved) this.last = { moved, map: this.smooth(withoutGlow(this.cells, this.glow, moved)) };
    return this.last.map;
  }

  /** Cells as a map; columns wrap, rows end at the poles and at the horizon. */
  private smooth(cells: Float64Array): Float32Array {
    const stride = 3 * this.cells.columns;
    const map = new Float32Array(3 * this.down.length * this.across.length);
    const line = new Float64Array(stride);
    let at = 0;
    for (const { low, high, share } of this.down) {
      for (let k = 0; k < stride; k++) line[k] = mixed(cells, low * stride + k, high * stride + k, share);
      for (const { low, high, share } of this.across) {
        for (let c = 0; c < 3; c++) map[at++] = mixed(line, 3 * low + c, 3 * high + c, share);
      }
    }
    return map;
  }
}

const mixed = (values: Float64Array, a: number, b: number, share: number): number =>
  (1 - share) * (values[a] as number) + share * (values[b] as number);

function between(place: number, inside: (cell: number) => number): Between {
  const low = Math.floor(place - 0.5);
  return { low: inside(low), high: inside(low + 1), share: place - 0.5 - low };
}

function glowOf({ rows, columns, factors }: Factors, before: Vector): Glow {
  const upper = (rows / 2) * columns;
  const logs = Float64Array.from({ length: 3 * upper }, (_, i) =>
    Math.log((factors[Math.floor(i / 3)] as Triple)[i % 3] as number),
  );
  const near = Float64Array.from({ length: upper }, (_, at) => {
    const elevation = 90 - ((Math.floor(at / columns) + 0.5) * 180) / rows;
    const towards = direction((((at % columns) + 0.5) / columns) * 360 - 180, elevation);
    return Math.exp(-((angleBetween(towards, before) / GLOW) ** 2));
  });
  const means = new Float64Array((3 * rows) / 2);
  for (let row = 0; row < rows / 2; row++) {
    let far = 0;
    for (let at = row * columns; at < (row + 1) * columns; at++) {
      const share = 1 - (near[at] as number);
      far += share;
      for (let c = 0; c < 3; c++) (means[3 * row + c] as number) += share * (logs[3 * at + c] as number);
    }
    for (let c = 0; c < 3; c++) (means[3 * row + c] as number) /= far;
  }
  return { before, near, logs, means };
}

/** The factors, three a cell, for a sun that was moved: around where it was, they are those of their row. */
function withoutGlow({ columns, factors }: Factors, { near, logs, means }: Glow, moved: number): Float64Array {
  const changed = Float64Array.from(factors.flat());
  for (let i = 0; i < logs.length; i++) {
    const at = Math.floor(i / 3);
    const mean = means[3 * Math.floor(at / columns) + (i % 3)] as number;
    const share = moved * (near[at] as number);
    changed[i] = Math.exp((1 - share) * (logs[i] as number) + share * mean);
  }
  return changed;
}
