#!/usr/bin/env bash
# Build the web page, server/web/dist, from its sources; commit what it changes. The same sources give the same bytes.
# Needs Node 20.19 or newer.
set -euo pipefail
cd "$(dirname "$0")/../server/web"
npm ci --no-fund --no-audit --ignore-scripts
npm run build
