/** Times and offsets from UTC as people and cameras write them, read as the service reads them. */

const OFFSETS = [-12, 14] as const; // hours from UTC of all zones

/** Hours from UTC in "+02:00", "-0330", "5.5" or "Z"; undefined where a text is none of these. */
export function parseUtcOffset(text: string): number | undefined {
  const parts = /^(?:([+-]?)(\d\d?):?([0-5]\d)|([+-]?\d\d?(?:\.\d+)?)|Z)$/.exec(text.trim());
  if (!parts) return undefined;
  const size = Number(parts[2] ?? 0) + Number(parts[3] ?? 0) / 60;
  const hours = parts[4] === undefined ? (parts[1] === "-" ? -size : size) : Number(parts[4]);
  return hours >= OFFSETS[0] && hours <= OFFSETS[1] ? hours : undefined;
}

/** Hours from UTC as ISO 8601 writes them: 5.5 is "+05:30". */
export function formatUtcOffset(hours: number): string {
  const minutes = Math.round(60 * Math.abs(hours));
  return `${hours < 0 ? "-" : "+"}${twoDigits(Math.floor(minutes / 60))}:${twoDigits(minutes % 60)}`;
}

/** A moment in UTC as 2024-06-01T14:30:05. */
export const formatUtcTime = (time: Date): string => time.toISOString().slice(0, 19);

const twoDigits = (value: number): string => String(value).padStart(2, "0");
