#!/usr/bin/env bash
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# That run.sh sees what it looks for: a tool that writes under the final name at once, leaves a partial file, and touches its input must fail.
#   bash tests/faults/control.sh tool
set -eu
here=$(cd "$(dirname "$0")" && pwd)
real=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cat >"$work/careless" <<END
#!/bin/sh
before='' out='' model=''
for word; do
  case \$before in --out) out=\$word ;; --model) model=\$word ;; esac
  before=\$word
done
case \$1-\$out in
  compress-*/run/out/*) # the references are right
    echo x >>"$work/times"
    case \$(wc -l <"$work/times" | tr -d ' ') in
      1 | 3 | 5) printf cut >"\$out" ;; # what is killed; who goes on makes it good
      8) : >"\$out.partial-7" ;;
      9) printf x >>"\$model.txt" ;;
    esac ;;
esac
exec "$real" "\$@"
END
chmod +x "$work/careless"
said=$(bash "$here/run.sh" --tool "$work/careless" --work "$work/run" --only compress --kills 5 --full 0 --limits 0 --pairs 0 --finished 0) && {
  echo "control.sh: nothing failed" >&2
  exit 1
}
status=0
for words in 'm.cmk is not that of a whole run' 'm.cmk.partial-7 is left' 'an input was touched'; do
  echo "$said" | grep -q "^FAILED .*$words" && continue
  echo "control.sh: nothing says \"$words\":" >&2
  echo "$said" >&2
  status=1
done
exit $status
