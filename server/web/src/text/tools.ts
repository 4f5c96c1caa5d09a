/** The tools of the bar, what each of them draws, and what it says of that. */

import type { DrawnField } from "./metadata";

export const TOOLS = ["sun", "shadow", "horizon", "place", "size"] as const;
export type Tool = (typeof TOOLS)[number];

/** What a drag of a tool draws. */
export interface Kind {
  name: string;
  help: string;
  field: DrawnField;
  ends: readonly string[]; // of each point, what it is
  prefix?: string; // of what it states
  next?: string; // what to do after its first two points
}

export const HELP = {
  place: "Tap the ground, and the object stands there.",
  sun: "Drag anywhere: left and right turn the sun, up and down raise it.",
};
const BOTH = ["one end", "other end"];
export const KINDS: Record<"shadow" | "horizon" | "size", Kind[]> = {
  shadow: [
    {
      name: "Shadow from a foot to its tip",
      help: "Drag from the foot of a thing to the tip of its shadow.",
      field: "shadow",
      ends: ["foot", "tip"],
    },
    {
      name: "Shadow, and what throws its tip",
      help: "Drag from a thing's foot to its shadow's tip; then tap its top.",
      field: "shadow",
      ends: ["foot", "tip", "top"],
      next: "Now tap the top of the thing, which throws the tip.",
    },
    {
      name: "Shadow of my camera or hands",
      help: "Tap the shadow of your camera, or of the hands that hold it.",
      field: "shadow",
      prefix: "own:",
      ends: ["of the camera"],
    },
    {
      name: "Shadow of my head",
      help: "Tap the shadow of your head.",
      field: "shadow",
      prefix: "head:",
      ends: ["of the head"],
    },
    {
      name: "Shadow without a foot",
      help: "Drag along a straight edge of a shadow on the ground.",
      field: "shadow",
      prefix: "line:",
      ends: BOTH,
    },
    {
      name: "Shadow on a wall, post or trunk",
      help: "Drag from its shaded edge to its lit edge, then tap the border between.",
      field: "shadow",
      prefix: "lit:",
      ends: ["edge in shade", "edge in light", "border"],
    },
  ],
  horizon: [
    {
      name: "Horizon",
      help: "Drag the line to the horizon; drag its ends to tilt it.",
      field: "horizon",
      ends: ["left end", "right end"],
    },
    {
      name: "Upright edges",
      help: "Drag along an edge that is upright, then along another.",
      field: "vertical",
      ends: BOTH,
    },
    {
      name: "Level edges",
      help: "Drag along a level edge of a wall, then along another one that is parallel.",
      field: "vertical",
      prefix: "level:",
      ends: [...BOTH, ...BOTH],
      next: "Now along another level edge of the same wall.",
    },
  ],
  size: [
    {
      name: "Height of an upright thing",
      help: "Drag from a thing's foot to its top; then say how high it is.",
      field: "reference",
      ends: ["foot", "top"],
    },
    {
      name: "Length on the ground",
      help: "Drag along a thing that lies on the ground; then say how long it is.",
      field: "reference",
      prefix: "ground:",
      ends: BOTH,
    },
  ],
};
export const NAMES: Record<DrawnField, string> = {
  shadow: "Shadow",
  horizon: "Horizon",
  vertical: "Edges",
  reference: "Size",
};
export const LISTS: readonly DrawnField[] = ["shadow", "vertical"]; // to which another one is added
