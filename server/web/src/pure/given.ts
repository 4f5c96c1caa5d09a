/** What the user says of photos, in the names of the service; what is not said is left to the photo. */

export interface Given {
  exif: boolean; // whether the photo's metadata count
  time: string; // local, as 2024-06-01T14:30
  utc_offset: string; // as +02:00
  lat: string;
  lon: string;
  heading: string; // of one photo, degrees from true north
  fov: string; // degrees
  headings: string; // of several photos, as 0,45,90
}

export type GivenName = Exclude<keyof Given, "exif">;

export const NOTHING: Given = {
  ...{ exif: true, time: "", utc_offset: "", lat: "", lon: "", heading: "", fov: "", headings: "" },
};

/** The query of what is said; `headings` goes with several photos only, `heading` with one. */
export function givenQuery(given: Given, photos: number): URLSearchParams {
  const query = new URLSearchParams();
  if (!given.exif) query.set("exif", "false");
  for (const [name, value] of Object.entries(given)) {
    if (typeof value !== "string" || !value.trim() || name === (photos > 1 ? "heading" : "headings")) continue;
    query.set(name, value.trim());
  }
  return query;
}
