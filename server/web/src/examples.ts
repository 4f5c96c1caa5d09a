/** Example photos; `examples/CREDITS.md` names their origins. */

import street from "../../../examples/brick_street.jpg";
import garden from "../../../examples/garden_windows.jpg";
import clouds from "../../../examples/lake_clouds.jpg";
import overcast from "../../../examples/rome/afternoon_square.jpg";
import golden from "../../../examples/rome/golden_hour.jpg";
import dusk from "../../../examples/shore_dusk.jpg";
import overcastThumb from "../../../examples/thumbs/afternoon_square.jpg";
import streetThumb from "../../../examples/thumbs/brick_street.jpg";
import gardenThumb from "../../../examples/thumbs/garden_windows.jpg";
import goldenThumb from "../../../examples/thumbs/golden_hour.jpg";
import cloudsThumb from "../../../examples/thumbs/lake_clouds.jpg";
import duskThumb from "../../../examples/thumbs/shore_dusk.jpg";

export interface Example {
  name: string;
  title: string;
  url: string;
  thumb: string;
  credit: string;
}

const ROME = "Anil Öztas, CC BY 4.0";
const PHONE = "cliff1976 and michaug2022, CC0";

export const EXAMPLES: Example[] = [
  { name: "brick_street.jpg", title: "Street", url: street, thumb: streetThumb, credit: PHONE },
  { name: "garden_windows.jpg", title: "Garden", url: garden, thumb: gardenThumb, credit: PHONE },
  { name: "lake_clouds.jpg", title: "Clouds", url: clouds, thumb: cloudsThumb, credit: PHONE },
  { name: "golden_hour.jpg", title: "Golden hour", url: golden, thumb: goldenThumb, credit: ROME },
  { name: "afternoon_square.jpg", title: "Overcast", url: overcast, thumb: overcastThumb, credit: ROME },
  { name: "shore_dusk.jpg", title: "Dusk", url: dusk, thumb: duskThumb, credit: PHONE },
];
