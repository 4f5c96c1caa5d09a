/** A location by the name of a city, from a list that the service holds: nobody else is asked. */

import citiesUrl from "../cities.tsv?url";
import { byId, createElement } from "../dom";
import { takePlace } from "./worldMap";

interface City {
  label: string; // as "Munich, Germany"
  names: string[]; // folded, for the search
  lat: string;
  lon: string;
}

const MAX_OFFERED = 8;
const MIN_LETTERS = 2;

/** Letters without accents and case, so that "koln" finds "Köln". */
export const foldName = (name: string): string => name.normalize("NFD").replaceAll(/\p{M}/gu, "").toLowerCase().trim();

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
export function listenForCities(): void {
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
  takePlace({ latitude: Number(lat), longitude: Number(lon) });
  byId("city-note").textContent = `${label}: ${lat}, ${lon}.`;
}

async function loadCities(): Promise<City[]> {
  const response = await fetch(citiesUrl).catch(() => undefined);
  if (!response?.ok) return [];
  const names = new Intl.DisplayNames(["en"], { type: "region" });
  return parseCities(await response.text(), (code) => names.of(code) ?? code);
}
