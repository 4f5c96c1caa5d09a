/** The sun's probability over the sky, as the service gives it: cells of a grid with angles and probabilities. */

import { direction, dot, radians, type Vector } from "./angles";

export interface Distribution {
  grid: string;
  azimuth: number[];
  elevation: number[];
  probability: number[];
}

export interface GridCell {
  ray: Vector;
  probability: number;
}

export function gridCells(distribution: Distribution): GridCell[] {
  return distribution.probability.map((probability, i) => ({
    ray: direction(distribution.azimuth[i] as number, distribution.elevation[i] as number),
    probability,
  }));
}

/** The probability that the sun is within `radius` degrees of a direction. */
export function probabilityWithin(cells: readonly GridCell[], ray: Vector, radius: number): number {
  const cosine = Math.cos(radians(radius));
  return cells.reduce((sum, cell) => sum + (dot(cell.ray, ray) >= cosine ? cell.probability : 0), 0);
}

/** Probability density per steradian, every cell spread over its neighborhood (0.6 times the cells' distance). */
export function smoothDensity(cells: readonly GridCell[]): (ray: Vector) => number {
  const concentration = (2.8 * cells.length) / (2 * Math.PI);
  const peak = Math.max(...cells.map((cell) => cell.probability));
  const considered = cells.filter((cell) => cell.probability > 1e-4 * peak);
  const reach = 1 - 8 / concentration; // beyond it a cell adds less than a three-thousandth
  return (ray) => {
    let sum = 0;
    for (const cell of considered) {
      const cosine = dot(cell.ray, ray);
      if (cosine > reach) sum += cell.probability * Math.exp(concentration * (cosine - 1));
    }
    return (sum * concentration) / (2 * Math.PI);
  };
}
