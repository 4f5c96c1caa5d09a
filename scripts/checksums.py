"""Write the checksums of the networks and tables in the package: python -m scripts.checksums

Run it after a file of lighting/data with one of CHECKED_SUFFIXES changed.
"""

from lighting.checksum import CHECKSUMS, DATA_FOLDER, list_checksums


def main() -> None:
    """Write and say where."""
    target = DATA_FOLDER / CHECKSUMS
    target.write_text(list_checksums(), encoding="ascii", newline="\n")
    print(target)


if __name__ == "__main__":
    main()
