/**
 * The photo's location by the name of a city, or by a click on a small map of all land. The service holds both: nobody
 * else is asked.
 */

import citiesUrl from "../cities.tsv?url";
import { arrowStep, byId, createElement } from "../dom";
import { clamp } from "../geometry/angles";

/** A location on the earth, degrees: positive north and east. */
interface GeoLocation {
  latitude: number;
  longitude: number;
}

const FIELDS = { latitude: "input-latitude", longitude: "input-longitude" } as const;
const STEP = 0.5; // degrees, of an arrow key
const LONG_STEP = 10; // with Shift
const CENTER: GeoLocation = { latitude: 0, longitude: 0 };

/** The location of a point of the map, in shares of its width and height. */
export const locationOfPoint = (x: number, y: number): GeoLocation => ({
  latitude: round(clamp(90 - 180 * y, -90, 90)),
  longitude: round(clamp(360 * x - 180, -180, 180)),
});

/** Where the map shows a location, in shares of its width and height. */
export const pointOfLocation = ({ latitude, longitude }: GeoLocation): [number, number] => [
  (longitude + 180) / 360,
  (90 - latitude) / 180,
];

/** A location so many degrees to the north and east, around the earth but not over its poles. */
export const moveLocation = ({ latitude, longitude }: GeoLocation, north: number, east: number): GeoLocation => ({
  latitude: round(clamp(latitude + north, -90, 90)),
  longitude: round(((((longitude + east + 180) % 360) + 360) % 360) - 180),
});

const round = (value: number): number => Math.round(100 * value) / 100;

/** "48.1° N, 11.6° E" */
export const formatLocation = ({ latitude, longitude }: GeoLocation): string =>
  `${Math.abs(latitude).toFixed(1)}° ${latitude < 0 ? "S" : "N"}, ${Math.abs(longitude).toFixed(1)}° ${longitude < 0 ? "W" : "E"}`;

/** Fills in the location of a city by its name, or of a click on the map; typed ones appear on the map. */
export function listenForLocation(): void {
  listenForCities();
  listenForWorldMap();
}

/** Fills in the location that is clicked, or reached by keys; typed ones appear on the map. */
function listenForWorldMap(): void {
  const map = byId("world");
  map.addEventListener("click", (event) => {
    const { left, top, width, height } = map.getBoundingClientRect();
    fillLocation(locationOfPoint((event.clientX - left) / width, (event.clientY - top) / height));
  });
  map.addEventListener("keydown", (event) => {
    const step = arrowStep(event, event.shiftKey ? LONG_STEP : STEP);
    if (!step) return;
    event.preventDefault();
    fillLocation(moveLocation(statedLocation() ?? CENTER, step[1], step[0]));
  });
  for (const id of Object.values(FIELDS)) byId(id).addEventListener("input", markLocation);
}

/** Marks on the map what latitude and longitude say. */
export function markLocation(): void {
  const location = statedLocation();
  const mark = byId("world-mark");
  const [x, y] = pointOfLocation(location ?? CENTER);
  mark.hidden = location === null;
  Object.assign(mark.style, { left: `${100 * x}%`, top: `${100 * y}%` });
  byId("world").setAttribute("aria-valuenow", String(location?.longitude ?? 0));
  byId("world").setAttribute("aria-valuetext", location ? formatLocation(location) : "no place");
}

/** Fills in a location, and marks it. */
function fillLocation(location: GeoLocation): void {
  for (const [name, id] of Object.entries(FIELDS)) {
    byId<HTMLInputElement>(id).value = String(location[name as keyof GeoLocation]);
  }
  markLocation();
}

function statedLocation(): GeoLocation | null {
  const [latitude, longitude] = [FIELDS.latitude, FIELDS.longitude].map(
    (id) => byId<HTMLInputElement>(id).valueAsNumber,
  );
  const isLocation = Math.abs(latitude as number) <= 90 && Math.abs(longitude as number) <= 180; // not so for NaN
  return isLocation ? { latitude: latitude as number, longitude: longitude as number } : null;
}

interface City {
  label: string; // as "Munich, Germany"
  names: string[]; // folded, for the search
  lat: string;
  lon: string;
}

const MAX_OFFERED = 8;
const MIN_LETTERS = 2;

/** Letters without accents and case, so that "koln" finds "Köln". */
const foldName = (name: string): string => name.normalize("NFD").replaceAll(/\p{M}/gu, "").toLowerCase().trim();

/** The cities of a list: name, country, latitude, longitude and other names, the largest first. */
export function parseCities(text: string, countryName: (code: string) => string): City[] {
  return text
    .trimEnd()
    .split("\n")
    .map((line) => {
      const [name = "", country = "", lat = "", lon = "", ...others] = line.split("\t");
      const local = others.length ? ` (${others.join(", ")})` : "";
      return { label: `${name}${local}, ${countryName(country)}`, names: [name, ...others].map(foldName), lat, lon };
    });
}

/** The largest cities whose name, or a word of it, begins with a text; those that begin with it come first. */
export function findCities(cities: readonly City[], text: string): City[] {
  const [wanted = "", ...rest] = text
    .replace(/ \(.*\)/, "")
    .split(",")
    .map(foldName);
  if (wanted.length < MIN_LETTERS) return [];
  const fits = (find: (name: string) => boolean) => (city: City) =>
    city.names.some(find) && (!rest[0] || foldName(city.label).includes(rest[0]));
  const first = cities.filter(fits((name) => name.startsWith(wanted)));
  const later = cities.filter(fits((name) => !name.startsWith(wanted) && name.includes(` ${wanted}`)));
  return [...first, ...later].slice(0, MAX_OFFERED);
}

/** Offers cities while a name is typed, and fills in the location of the one that is chosen. */
function listenForCities(): void {
  const field = byId<HTMLInputElement>("input-city");
  let cities: City[] = [];
  const load = async (): Promise<void> => {
    if (cities.length === 0) cities = await loadCities();
  };
  field.addEventListener("focus", load);
  field.addEventListener("input", async () => {
    await load();
    const found = findCities(cities, field.value);
    const chosen = found.find(({ label }) => label === field.value);
    if (chosen) takeCity(chosen);
    else byId("cities").replaceChildren(...found.map(({ label }) => createElement("option", { value: label })));
  });
  field.addEventListener("change", () => {
    const [largest] = findCities(cities, field.value);
    if (largest?.names.includes(foldName(field.value.split(/ \(|,/)[0] ?? ""))) takeCity(largest);
  });
}

function takeCity({ label, lat, lon }: City): void {
  byId<HTMLInputElement>("input-city").value = label;
  fillLocation({ latitude: Number(lat), longitude: Number(lon) });
  byId("city-note").textContent = `${label}: ${lat}, ${lon}.`;
}

async function loadCities(): Promise<City[]> {
  const response = await fetch(citiesUrl).catch(() => undefined);
  if (!response?.ok) return [];
  const names = new Intl.DisplayNames(["en"], { type: "region" });
  return parseCities(await response.text(), (code) => names.of(code) ?? code);
}
