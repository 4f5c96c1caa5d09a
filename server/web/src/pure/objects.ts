/** The names that the controls and the scene share. */

export const SHAPES = ["sphere", "teapot", "knot", "box", "own"] as const; // own: the user's file
export const FINISHES = ["mirror", "glossy", "matte", "file's own"] as const;

export type Shape = (typeof SHAPES)[number];
export type Finish = (typeof FINISHES)[number];
