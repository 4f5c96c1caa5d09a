/** Example photos, CC0; `examples/CREDITS.md` names their origins. */

import hill from "../../../examples/hill_clouds.jpg";
import overcast from "../../../examples/overcast_street.jpg";
import park from "../../../examples/park_evening.jpg";
import railway from "../../../examples/railway_field.jpg";
import venice from "../../../examples/venice_alley.jpg";
import street from "../../../examples/wide_street.jpg";

export interface Example {
  name: string;
  title: string;
  url: string;
}

export const EXAMPLES: Example[] = [
  { name: "wide_street.jpg", title: "Wide street", url: street },
  { name: "railway_field.jpg", title: "Railway field", url: railway },
  { name: "hill_clouds.jpg", title: "Hill with clouds", url: hill },
  { name: "venice_alley.jpg", title: "Venetian alley", url: venice },
  { name: "park_evening.jpg", title: "Park at evening", url: park },
  { name: "overcast_street.jpg", title: "Overcast street", url: overcast },
];
