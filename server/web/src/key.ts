/** The API key, for services that ask for one; forgotten with the browser's tab. */

const NAME = "lighting-api-key";

export const apiKey = (): string | null => sessionStorage.getItem(NAME);

/** The header that carries a key. */
export const keyHeader = (key: string): Record<string, string> => ({ Authorization: `Bearer ${key}` });

/** Keeps a key; false for one with characters that no request can carry, which is not kept. */
export function keepKey(key: string): boolean {
  try {
    new Headers(keyHeader(key));
  } catch {
    return false;
  }
  sessionStorage.setItem(NAME, key);
  return true;
}
