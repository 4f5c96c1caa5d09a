/** The API key, for services that ask for one; forgotten with the browser's tab. */

const NAME = "lighting-api-key";

export const apiKey = (): string | null => sessionStorage.getItem(NAME);
export const keepKey = (key: string): void => sessionStorage.setItem(NAME, key);
