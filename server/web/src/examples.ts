/** Example photos; `examples/CREDITS.md` names their origins. */

import forest from "../../../examples/forest_clearing.jpg";
import noon from "../../../examples/garden_noon.jpg";
import overcast from "../../../examples/overcast_street.jpg";
import golden from "../../../examples/rome/golden_hour.jpg";
import alley from "../../../examples/rome/street_in_shade.jpg";
import snow from "../../../examples/snow_field.jpg";
import forestThumb from "../../../examples/thumbs/forest_clearing.jpg";
import noonThumb from "../../../examples/thumbs/garden_noon.jpg";
import goldenThumb from "../../../examples/thumbs/golden_hour.jpg";
import overcastThumb from "../../../examples/thumbs/overcast_street.jpg";
import snowThumb from "../../../examples/thumbs/snow_field.jpg";
import alleyThumb from "../../../examples/thumbs/street_in_shade.jpg";

export interface Example {
  name: string;
  title: string;
  url: string;
  thumb: string;
  credit: string;
}

const ROME = "Anil Öztas, CC BY 4.0";
const HAVEN = "Poly Haven, CC0";

export const EXAMPLES: Example[] = [
  { name: "golden_hour.jpg", title: "Golden hour", url: golden, thumb: goldenThumb, credit: ROME },
  { name: "garden_noon.jpg", title: "Noon", url: noon, thumb: noonThumb, credit: HAVEN },
  { name: "overcast_street.jpg", title: "Overcast", url: overcast, thumb: overcastThumb, credit: HAVEN },
  { name: "forest_clearing.jpg", title: "Forest", url: forest, thumb: forestThumb, credit: HAVEN },
  { name: "snow_field.jpg", title: "Snow", url: snow, thumb: snowThumb, credit: HAVEN },
  { name: "street_in_shade.jpg", title: "Street", url: alley, thumb: alleyThumb, credit: ROME },
];
