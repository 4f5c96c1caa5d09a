"""The lines of Docker on docs/do/run-the-service.md, carried out by an image that is built, and by Caddy."""

import fcntl
import os
import shlex
import shutil
import signal
import socket
import ssl
import struct
import subprocess
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from scripts.book import ROOT, read_code_blocks
from scripts.image_process import START, STOP, Image, check_requests, expect, started, wait_healthy

PAGE = ROOT / "docs" / "do" / "run-the-service.md"
MARK = "image"  # of the page's block of Docker's lines
HTTPS = 443  # port


def read_docker_lines() -> list[list[str]]:
    """The words of each line of the page's block of Docker."""
    (text,) = (b.text for b in read_code_blocks(PAGE.read_text(encoding="utf-8")) if b.mark == MARK)
    return [shlex.split(line, comments=True) for line in text.splitlines()]


def check_run_options(run: list[str], image: Image) -> None:
    """Check that `docker run` of the page gives the options under which the service just ran, and no other.

    Args:
        run: the line's words.
        image: that ran.
    """
    ran = ["docker", "run", "--rm", "-p", f"8000:{image.port}", "--read-only", "--cap-drop", "ALL"]
    expect(run[:-1] == ran, f"it ran as `{' '.join(run)}` says")


def check_compose(image: Image, lines: list[list[str]]) -> None:
    """Run the service by compose.yaml's settings, and Caddy in front of it, as the page's lines do.

    Both have the proxy's address, which this network of a loopback gets too.

    Args:
        image: of the service.
        lines: the words of `docker compose up`, and of the same with the proxy for a site.
    """
    import yaml

    services = yaml.safe_load((ROOT / "compose.yaml").read_text(encoding="utf-8"))["services"]
    alone, (site, *proxied) = lines
    expect(alone == ["docker", "compose", "up", "--build"], "the page starts compose.yaml")
    profile = services["proxy"]["profiles"]
    expect(proxied == [*alone[:2], "--profile", *profile, *alone[2:]], "and its proxy, by the profile's name")
    settings = services["lighting"]["environment"]
    _add_address(address := services["proxy"]["networks"]["default"]["ipv4_address"])
    composed = replace(image, environment=[*image.environment, *(f"{k}={v}" for k, v in settings.items())])
    with started(composed) as (service, pid):
        expect(bool(wait_healthy(composed.command(image.health), service)), "it runs by the settings of compose.yaml")
        check_requests(image.port)
        if shutil.which("caddy"):
            check_proxy(f"{address}:{image.port}", site.partition("=")[2], services["proxy"]["environment"])
        else:
            print("skipped: there is no caddy for the proxy of compose.yaml")
        os.kill(pid, signal.SIGTERM)
        service.wait(STOP)


def check_proxy(service: str, site: str, variables: dict[str, str | int]) -> None:
    """Ask the service over TLS by the name of a site, whose certificate Caddy itself signs.

    Args:
        service: its address and port.
        site: its host name.
        variables: of the Caddyfile.
    """
    own = {"SITE": site, "SERVICE": service}
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, **{k: str(v) for k, v in variables.items()}, **own, "XDG_DATA_HOME": folder}
        config = Path(folder, "Caddyfile")
        text = (ROOT / "Caddyfile").read_text(encoding="utf-8")
        config.write_text(text.replace("\n{\n", "\n{\n\tadmin off\n\tlocal_certs\n\tskip_install_trust\n", 1))
        command = ["caddy", "run", "--config", str(config), "--adapter", "caddyfile"]
        with subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL) as proxy:
            try:
                status = wait_for_site(proxy, site, Path(folder, "caddy/pki/authorities/local/root.crt"))
            finally:
                proxy.kill()
    expect(status == 200, f"https://{site} answers through Caddy")


def wait_for_site(proxy: "subprocess.Popen[bytes]", site: str, root: Path) -> int:
    """The status of a site's readiness once it answers; 0 if it does not in time.

    Args:
        proxy: that answers.
        site: its host name.
        root: the certificate that signs the site's.
    """
    began = time.monotonic()
    while time.monotonic() - began < START and proxy.poll() is None:
        try:
            return _ask_site(site, ssl.create_default_context(cafile=root))
        except OSError:
            time.sleep(0.2)
    return 0


def _ask_site(site: str, context: ssl.SSLContext) -> int:
    """The status of /readyz at a site of the loopback."""
    with (
        socket.create_connection(("127.0.0.1", HTTPS), START) as plain,
        context.wrap_socket(plain, server_hostname=site) as secure,
    ):
        secure.sendall(f"GET /readyz HTTP/1.1\r\nHost: {site}\r\nConnection: close\r\n\r\n".encode())
        return int(secure.recv(12).split()[1])


def _add_address(address: str) -> None:
    """`ip address add ADDRESS dev lo`."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as anything:
        request = struct.pack("16sH2x4s8x", b"lo:1", socket.AF_INET, socket.inet_aton(address))
        fcntl.ioctl(anything, 0x8916, request)  # SIOCSIFADDR
