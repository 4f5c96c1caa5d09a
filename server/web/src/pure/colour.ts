/** Colours of numbers. */

export type Rgb = readonly [red: number, green: number, blue: number];

/** "#1e222a" as three bytes. */
export function rgbOf(hex: string): Rgb {
  const value = Number.parseInt(hex.trim().slice(1), 16);
  return [(value >> 16) & 255, (value >> 8) & 255, value & 255];
}

/** The colour at `level` (0 to 1) between equally spaced stops. */
export function between(stops: readonly Rgb[], level: number): Rgb {
  const position = Math.min(Math.max(level, 0), 1) * (stops.length - 1);
  const low = Math.min(Math.floor(position), stops.length - 2);
  const [a, b, share] = [stops[low] as Rgb, stops[low + 1] as Rgb, position - low];
  const mix = (i: 0 | 1 | 2): number => Math.round(a[i] + (b[i] - a[i]) * share);
  return [mix(0), mix(1), mix(2)];
}
