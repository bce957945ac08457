#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# table.sh SOURCE: the table of captures and the page of examples/cluster, without Snakemake and without the tool.
set -eu
if ! command -v python3 >/dev/null 2>&1; then
  echo "skipped: no python3"
  exit 0
fi
PYTHONPATH=$1/examples/cluster PYTHONDONTWRITEBYTECODE=1 python3 "$1/tests/cluster/table.py"
