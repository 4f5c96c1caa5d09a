# The service and the command line in one image; docs/do/run-the-service.md says how to run it.
#
# Bases: the tag is for people, the digest (of the multi-architecture index) is what is pulled. `docker buildx imagetools
# inspect python:3.11-slim-bookworm` prints the newest.

FROM python:3.11.16-slim-bookworm@sha256:a36c24f9cbdf4fd0f52d67f0823eeac19c2028c637cecc392d97f980d4fec56b AS venv
WORKDIR /build
ENV PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_ROOT_USER_ACTION=ignore \
    UV_NO_CACHE=1 UV_COMPILE_BYTECODE=1 UV_PYTHON_DOWNLOADS=never UV_PROJECT_ENVIRONMENT=/opt/venv
RUN python -m venv --without-pip /opt/uv && \
    echo "uv==0.13.9 --hash=sha256:d7f459fe4fd247d830351c75686d3996ace3c6f3f728eb0e85a30b7ada0cef19 --hash=sha256:5435c5ce14a56431208ca0996416d310f1598e8c2c8ba707688985a16bb82dbe" > uv.txt && \
    python -m pip --python /opt/uv/bin/python install --require-hashes --only-binary :all: --requirement uv.txt
COPY pyproject.toml uv.lock ./
# `--build-arg TURNS=1` adds OpenCV, which matches several photos with each other and is 160 MB.
# `--build-arg TRACES=1` adds OpenTelemetry, for LIGHTING_OTLP_ENDPOINT.
ARG TURNS=
ARG TRACES=
RUN /opt/uv/bin/uv sync --frozen --no-build --no-install-project --python "$(command -v python)" ${TURNS:+--extra turns} ${TRACES:+--extra traces}
COPY CHANGELOG.md README.md SECURITY.md LICENSE NOTICE ./
COPY docs/ docs/
COPY lighting/ lighting/
COPY server/ server/
RUN /opt/uv/bin/uv sync --locked --no-editable --inexact && /opt/venv/bin/lighting doctor --quiet

FROM python:3.11.16-slim-bookworm@sha256:a36c24f9cbdf4fd0f52d67f0823eeac19c2028c637cecc392d97f980d4fec56b
ARG VERSION=unknown
ARG REVISION=unknown
ARG SOURCE=unknown
LABEL org.opencontainers.image.title="outdoor-lighting" \
      org.opencontainers.image.description="Light estimation from one outdoor photo: HTTP API, web page and command line" \
      org.opencontainers.image.licenses="Apache-2.0" \
      org.opencontainers.image.version="$VERSION" \
      org.opencontainers.image.revision="$REVISION" \
      org.opencontainers.image.source="$SOURCE" \
      org.opencontainers.image.base.name="docker.io/library/python:3.11.16-slim-bookworm"
COPY --from=venv /opt/venv /opt/venv
# One thread of numpy's for each photo: the service itself works on as many photos at once as there are cores.
ENV PATH=/opt/venv/bin:$PATH \
    PYTHONUNBUFFERED=1 \
    PYTHONDONTWRITEBYTECODE=1 \
    OMP_NUM_THREADS=1 \
    LIGHTING_HOST=0.0.0.0 \
    LIGHTING_PORT=8000
WORKDIR /work
USER 10001:10001
EXPOSE 8000
# Without a proxy, whatever the environment says: the service is on this machine.
HEALTHCHECK --interval=30s --timeout=5s --start-period=20s --retries=3 CMD ["python", "-c", "import os, urllib.request as u; u.build_opener(u.ProxyHandler({})).open(f\"http://127.0.0.1:{os.environ['LIGHTING_PORT']}/livez\", timeout=4)"]
# `env` runs what follows it in its own place: no shell, and the program itself gets the signals.
ENTRYPOINT ["/usr/bin/env"]
CMD ["lighting-server"]
