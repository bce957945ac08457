#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# test.sh LIBRARY SOURCE: the Python module on the library, and as it is installed: it finds the library of its own prefix, wherever the system has those.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
# A Python of one's own may be before the system's, which has the package.
for python in python3 /usr/bin/python3; do
  if "$python" -c 'import numpy' 2>/dev/null; then
    COMPMARK_LIBRARY=$1 PYTHONPATH=$2/bindings/python PYTHONDONTWRITEBYTECODE=1 "$python" "$2/bindings/python/test.py" "$2"
    for place in lib lib/x86_64-linux-gnu lib64; do
      prefix=$folder/$(echo "$place" | tr / _)
      mkdir -p "$prefix/lib/python3/dist-packages" "$prefix/$place"
      cp "$2/bindings/python/compmark.py" "$prefix/lib/python3/dist-packages"
      cp "$1" "$prefix/$place/libcompmark.so.1"
      found=$(env -u COMPMARK_LIBRARY PYTHONPATH="$prefix/lib/python3/dist-packages" "$python" -c 'import compmark; print(compmark._place())')
      [ "$found" = "$prefix/$place/libcompmark.so.1" ] || { echo "the library in $place was not found, but $found"; exit 1; }
    done
    exit
  fi
done
echo "skipped: no numpy (install the package python3-numpy)"
