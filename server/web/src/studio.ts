/** What the page shows: photos with their estimates, and for each what the user has done to its light and object. */

import type { Estimate, Parameters, Power } from "./api";
import { parametersOf } from "./parameters";
import { aspectOf, type Photo } from "./photo";
import { groundColour, litGround } from "./picture/ground";
import { quietSpot } from "./picture/room";
import type { Given } from "./pure/given";
import { History } from "./pure/history";
import type { Finish, Shape } from "./pure/objects";
import { type Place, placeFor } from "./pure/place";
import type { Question } from "./sky/light";
import type { Triple } from "./sky/model";

/** What can be changed, and undone. */
export interface Look {
  parameters: Parameters;
  place: Place;
  shape: Shape;
  finish: Finish;
}

/** One photo with its answer. */
export interface View {
  photo: Photo;
  answer: Estimate;
  history: History<Look>;
  power: Power; // of the light on show
  ground: Triple | undefined; // the photo's own, linear
  lit: Uint8Array; // where it lies in the sun
}

/** Photos that were estimated together, one of them on show. */
export interface Shown {
  views: View[];
  at: number;
  given: Given;
}

export function viewOf(photo: Photo, answer: Estimate): View {
  const { camera } = answer;
  const place = placeFor(camera, aspectOf(photo), quietSpot(photo.pixels, camera));
  const look: Look = { parameters: parametersOf(answer), place, shape: "sphere", finish: "mirror" };
  return {
    ...{ photo, answer, history: new History(look), power: { sun: [0, 0, 0], sky: [0, 0, 0] } },
    ground: groundColour(photo.pixels, camera),
    lit: litGround(photo.pixels, answer),
  };
}

export const filesOf = ({ views }: Shown): File[] => views.map(({ photo }) => photo.file);
export const lookOf = ({ history }: View): Look => history.state;

/** What the sky's worker is asked for a view. */
export function questionOf(view: View): Question {
  const { sun, sky, ground } = view.answer;
  return {
    parameters: lookOf(view).parameters,
    asked: parametersOf(view.answer),
    stated: {
      ...(sun.irradiance ? { sun: sun.irradiance } : {}),
      ...(sky.irradiance ? { sky: sky.irradiance } : {}),
      ...(sky.cover === undefined ? {} : { cover: sky.cover }),
      ...(ground ? { ground: ground.color } : {}),
    },
    groundSeen: view.ground,
  };
}
