#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# A compiler launcher for the header sets (clang++): each header is compiled alone, after the precompiled header that shared_headers.awk gave it; that is
# made by who asks first, and who asks meanwhile does without. A header that was given none is compiled as it is.
#   with_shared_headers.sh <table of shared_headers.awk> <folder for precompiled headers> <compiler> <flags…>
set -eu
table=$1
folder=$2
shift 2
for source; do :; done # the last argument: …/compmark_verify_interface_header_sets/compmark/io/ply.hpp.cxx
header=${source##*/compmark_verify_interface_header_sets/}
shared=$(awk -v header="${header%.cxx}" '$1 == header { print $2 }' "$table")
[ -n "$shared" ] || exec "$@"

precompiled=$folder/$(echo "$shared" | tr / .).pch
if ! [ -e "$precompiled" ]; then
  mkdir -p "$folder"
  (
    flock -n 9 && ! [ -e "$precompiled" ] || exit 0
    # Our flags without what is of this source alone.
    count=$#
    while [ "$count" -gt 0 ]; do
      case $1 in
        -o | -c | -MT | -MF | -x) shift; count=$((count - 1)) ;; # with the word that follows
        -MD) ;;
        *) set -- "$@" "$1" ;;
      esac
      shift
      count=$((count - 1))
    done
    echo "#include <$shared>" >"$precompiled.hpp"
    "$@" -Xclang -fno-pch-timestamp -x c++-header "$precompiled.hpp" -o "$precompiled.new"
    mv "$precompiled.new" "$precompiled"
  ) 9>"$precompiled.lock"
fi
[ -e "$precompiled" ] || exec "$@"
exec "$@" -include-pch "$precompiled"
