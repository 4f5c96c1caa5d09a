/** The names that the controls and the scene share. */

export const SHAPES = ["sphere", "teapot", "knot", "box"] as const;
export const FINISHES = ["chrome", "paint", "clay"] as const;

export type Shape = (typeof SHAPES)[number];
export type Finish = (typeof FINISHES)[number];
