#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# test.sh LIBRARY SOURCE: the Python module on the library.
set -eu
# A Python of one's own may be before the system's, which has the package.
for python in python3 /usr/bin/python3; do
  if "$python" -c 'import numpy' 2>/dev/null; then
    COMPMARK_LIBRARY=$1 PYTHONPATH=$2/bindings/python PYTHONDONTWRITEBYTECODE=1 "$python" "$2/bindings/python/test.py" "$2"
    exit
  fi
done
echo "skipped: no numpy (install the package python3-numpy)"
