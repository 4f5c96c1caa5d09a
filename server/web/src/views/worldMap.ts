/** A location by a small map of all land, which the service holds: a click or the arrow keys fill in latitude and longitude. */

import { byId } from "../dom";
import { clamp } from "../geometry/angles";

/** A place on the earth, degrees: positive north and east. */
export interface Place {
  latitude: number;
  longitude: number;
}

const FIELDS = { latitude: "input-latitude", longitude: "input-longitude" } as const;
const STEP = 0.5; // degrees, of an arrow key
const LONG_STEP = 10; // with Shift
const CENTER: Place = { latitude: 0, longitude: 0 };

/** The place of a point of the map, in shares of its width and height. */
export const placeOfPoint = (x: number, y: number): Place => ({
  latitude: round(clamp(90 - 180 * y, -90, 90)),
  longitude: round(clamp(360 * x - 180, -180, 180)),
});

/** Where the map shows a place, in shares of its width and height. */
export const pointOfPlace = ({ latitude, longitude }: Place): [number, number] => [
  (longitude + 180) / 360,
  (90 - latitude) / 180,
];

/** A place so many degrees to the north and east, around the earth but not over its poles. */
export const movePlace = ({ latitude, longitude }: Place, north: number, east: number): Place => ({
  latitude: round(clamp(latitude + north, -90, 90)),
  longitude: round(((((longitude + east + 180) % 360) + 360) % 360) - 180),
});

const round = (value: number): number => Math.round(100 * value) / 100;

/** "48.1° N, 11.6° E" */
export const formatPlace = ({ latitude, longitude }: Place): string =>
  `${Math.abs(latitude).toFixed(1)}° ${latitude < 0 ? "S" : "N"}, ${Math.abs(longitude).toFixed(1)}° ${longitude < 0 ? "W" : "E"}`;

/** Fills in the location that is clicked, or reached by keys; typed ones appear on the map. */
export function listenForWorldMap(): void {
  const map = byId("world");
  map.addEventListener("click", (event) => {
    const { left, top, width, height } = map.getBoundingClientRect();
    takePlace(placeOfPoint((event.clientX - left) / width, (event.clientY - top) / height));
  });
  map.addEventListener("keydown", (event) => {
    const step = event.shiftKey ? LONG_STEP : STEP;
    const steps: Record<string, readonly [number, number]> = {
      ArrowUp: [step, 0],
      ArrowDown: [-step, 0],
      ArrowLeft: [0, -step],
      ArrowRight: [0, step],
    };
    const by = steps[event.key];
    if (!by || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    takePlace(movePlace(statedPlace() ?? CENTER, ...by));
  });
  for (const id of Object.values(FIELDS)) byId(id).addEventListener("input", showPlace);
}

/** Marks on the map what latitude and longitude say. */
export function showPlace(): void {
  const place = statedPlace();
  const mark = byId("world-mark");
  const [x, y] = pointOfPlace(place ?? CENTER);
  mark.hidden = place === null;
  Object.assign(mark.style, { left: `${100 * x}%`, top: `${100 * y}%` });
  byId("world").setAttribute("aria-valuenow", String(place?.longitude ?? 0));
  byId("world").setAttribute("aria-valuetext", place ? formatPlace(place) : "no place");
}

/** Fills in a place, and marks it. */
export function takePlace(place: Place): void {
  for (const [name, id] of Object.entries(FIELDS)) {
    byId<HTMLInputElement>(id).value = String(place[name as keyof Place]);
  }
  showPlace();
}

function statedPlace(): Place | null {
  const [latitude, longitude] = [FIELDS.latitude, FIELDS.longitude].map(
    (id) => byId<HTMLInputElement>(id).valueAsNumber,
  );
  const isPlace = Math.abs(latitude as number) <= 90 && Math.abs(longitude as number) <= 180; // not so for NaN
  return isPlace ? { latitude: latitude as number, longitude: longitude as number } : null;
}
