#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# What a comment or a page cites is in the repository. "docs/spec/PAGE.md, 4.4" names a section, "docs/spec/numerics.md, BB1" and "case BB1" a case: each
# has its heading there; every page of docs/ that is named exists; every path of a page in backticks that begins with a folder of the repository exists;
# every link of a page leads to a file, and to a heading of it; and nothing cites a
# document that only its writers had. Last, a small tree with one fault of each kind has to be refused (negative control).
#   citations.sh <project root>
set -eu
export LC_ALL=C
root=$(cd "${1:-.}" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT INT TERM

# Sections and cases: "page.md id", one a line.
anchors() {
  for page in docs/spec/*.md; do
    sed -nE -e 's/^#+ ([0-9]+(\.[0-9]+)*|[A-Z]{2}[0-9]+)([ .:].*|$)/\1/p' -e 's/^(\* )?\*\*([0-9]+(\.[0-9]+)*|[A-Z]{2}[0-9]+)[ .:].*/\2/p' -e 's/^\| (T[0-9]+) \|.*/\1/p' "$page" |
      sed "s#^#${page} #"
  done
}

# Headings of all pages as links name them: "page.md#heading".
headings() {
  find . -name '*.md' -not -path './build/*' | sed 's#^\./##' | while read -r page; do
    awk '/^```/ { code = !code } !code && /^#+ / { sub(/^#+ /, ""); print tolower($0) }' "$page" | sed -E -e 's/\[([^]]*)\]\([^)]*\)/\1/g' -e 's/[^a-z0-9 _-]//g' -e 's/ /-/g' -e "s#^#${page}\##"
    grep -oE '<a (id|name)="[^"]+"' "$page" | sed -E "s/.*\"(.*)\"/\1/; s#^#${page}\##" || true
  done
}

# All text with the lines of a comment joined: "file:line<TAB>text".
text() {
  find include tests examples benchmarks docs cmake weights README.md CHANGELOG.md CMakeLists.txt -type f \
    \( -name '*.hpp' -o -name '*.cpp' -o -name '*.md' -o -name '*.txt' -o -name '*.cmake' -o -name '*.sh' \) 2>/dev/null |
    grep -vE '^tests/hygiene/(citations|numerics_cases)\.sh$' | sort >"$work/files"
  [ ! -f .ci/run ] || echo .ci/run >>"$work/files"
  # shellcheck disable=SC2046 # names without blanks
  awk '
    function flush() { if (held != "") print where "\t" held; held = "" }
    FNR == 1 { flush() }
    { line = $0; comment = line ~ /^[ \t]*(\/\/|#|\*)/ || FILENAME ~ /\.md$/
      if (comment && FILENAME !~ /\.md$/) sub(/^[ \t]*(\/\/[\/!]?<?|#+|\*)[ \t]*/, "", line)
      blank = line ~ /^[ \t]*$/
      if (held != "" && comment && !blank && (FILENAME !~ /\.md$/ || line !~ /^(#|\||\* |- |```)/)) { held = held " " line; next }
      flush()
      if (!blank) { held = line; where = FILENAME ":" FNR }
    }
    END { flush() }' $(cat "$work/files")
}

# Everything that is wrong with the tree in the current folder, a line each.
faults() {
  anchors | sort -u >"$work/anchors"
  headings | sort -u >"$work/headings"
  text >"$work/text"
  awk -F '\t' -v anchors="$work/anchors" '
    BEGIN {
      while ((getline line <anchors) > 0) {
        known[line] = 1
        split(line, part, " ")
        if (part[1] == "docs/spec/numerics.md") { family = substr(part[2], 1, 2); families[family] = 1 }
      }
      close(anchors)
      id = "([0-9]+(\\.[0-9]+)*|[A-Z][A-Z]?[0-9]+)"
    }
    { where = $1; sub(/^[^\t]*\t/, ""); all = $0
      rest = all
      while (match(rest, "docs/spec/[a-z_]+\\.md, " id "((, and |, | and | to )" id ")*")) {
        cited = substr(rest, RSTART, RLENGTH); rest = substr(rest, RSTART + RLENGTH)
        page = cited; sub(/, .*/, "", page); list = cited; sub(/^[^,]*, /, "", list); gsub(/, and | and | to /, ", ", list)
        n = split(list, ids, ", ")
        for (i = 1; i <= n; i++) if (!((page " " ids[i]) in known)) print where ": " page " has no section or case " ids[i]
      }
      rest = all
      while (match(rest, /(^|[^A-Za-z0-9_.])[A-Z][A-Z][0-9]+([^A-Za-z0-9_]|$)/)) {
        name = substr(rest, RSTART, RLENGTH); rest = substr(rest, RSTART + RLENGTH - 1); gsub(/[^A-Z0-9]/, "", name)
        # BF16 is a number format
        if ((substr(name, 1, 2) in families) && name != "BF16" && !(("docs/spec/numerics.md " name) in known)) print where ": there is no case " name " in docs/spec/numerics.md"
      }
      rest = all
      while (match(rest, /docs\/[A-Za-z0-9_\/]+\.(md|svg|jpg)/)) {
        named = substr(rest, RSTART, RLENGTH); rest = substr(rest, RSTART + RLENGTH)
        if (system("test -e " named) != 0) print where ": there is no " named
      }
      lower = tolower(all)
      if (lower ~ /(method|compression|watermark|numerics|ecosystem|performance|fact) sheet|(^|[^a-z])sheet,? ([0-9]|section|item)|the sheet|numerics case|(^|[^a-z])trap [a-z]?[0-9]/ || all ~ /(^|[^A-Za-z_])(DESIGN|design card)([^A-Za-z_]|$)/)
        print where ": cites a document that is not in the repository"
    }' "$work/text"
  # Paths of the repository in backticks: `tests/io/{image_file,ply}.test.cpp`, `tests/scene/*.test.cpp`. The changelog tells of files that are gone.
  find README.md CONTRIBUTING.md SECURITY.md docs weights tests examples -name '*.md' 2>/dev/null | sort | while read -r page; do
    { grep -onE '`(tests|include|docs|examples|weights)/[A-Za-z0-9_./*{},-]+`' "$page" || true; } | tr -d '`' | sed "s#^#$page:#"
  done | awk '
    function alternatives(before, path,   begin, end, n, each, i) {
      if (!match(path, /\{[^{}]*\}/)) { print before path; return }
      begin = substr(path, 1, RSTART - 1); end = substr(path, RSTART + RLENGTH)
      n = split(substr(path, RSTART + 1, RLENGTH - 2), each, ",")
      for (i = 1; i <= n; i++) alternatives(before, begin each[i] end)
    }
    { match($0, /^[^:]*:[0-9]+:/); alternatives(substr($0, 1, RLENGTH) " ", substr($0, RLENGTH + 1)) }' |
    while read -r where path; do
      # shellcheck disable=SC2086 # a pattern is to be expanded
      set -- $path
      [ -e "$1" ] || echo "$where there is no $path"
    done
  # Links of the pages.
  grep -oHnE '\]\([^) ]+\)' README.md CHANGELOG.md $(find docs weights -name '*.md' 2>/dev/null) 2>/dev/null | sed -E 's/^([^:]+):([0-9]+):\]\((.*)\)$/\1 \2 \3/' | while read -r page line target; do
    case $target in http://* | https://* | mailto:*) continue ;; esac
    file=${target%%#*} fragment=
    case $target in *'#'*) fragment=${target#*#} ;; esac
    folder=$(dirname "$page")
    if [ -n "$file" ]; then path=$(realpath -m --relative-to=. "$folder/$file"); else path=$page; fi
    if [ ! -e "$path" ]; then
      echo "$page:$line: the link $target leads nowhere"
    elif [ -n "$fragment" ] && [ "${path##*.}" = md ] && ! grep -qxF "$path#$fragment" "$work/headings"; then
      echo "$page:$line: $path has no heading #$fragment"
    fi
  done
}

cd "$root"
faults >"$work/faults"
cat "$work/faults"
bad=$(wc -l <"$work/faults")
echo "$(wc -l <"$work/anchors") sections and cases, $(grep -oE 'docs/spec/[a-z_]+\.md, ' "$work/text" | wc -l) citations, $bad without a target"

# The negative control: a tree without a fault, and then one fault at a time.
control() {
  rm -rf "$work/tree" && mkdir -p "$work/tree/include" "$work/tree/docs/spec" && cd "$work/tree"
  printf '# Method\n\n## 4 Growing\n\n### 4.4 Levels\n' >docs/spec/method.md
  printf '# Cases\n\n### BB1. Blending\n' >docs/spec/numerics.md
  printf '# Read me\n\nSee [the method](docs/spec/method.md#44-levels), `docs/spec/*.md` and `include/{a}.hpp`.\n' >README.md
  printf '// As in docs/spec/method.md, 4 and\n// 4.4, and docs/spec/numerics.md, BB1 (case BB1).\nint x;\n' >include/a.hpp
}
control && faults >"$work/faults"
[ ! -s "$work/faults" ] || { echo "a tree without a fault was refused:" && cat "$work/faults" && exit 1; }
planted=0
plant() { # <file> <text> <what must be said>
  control && printf '%b\n' "$2" >>"$1" && faults >"$work/faults"
  planted=$((planted + 1))
  grep -q "$3" "$work/faults" || { echo "not seen in $1: $2" && exit 1; }
}
plant include/a.hpp '// docs/spec/method.md, 4.4 and\n// 4.5' 'no section or case 4.5'
plant include/a.hpp '// docs/spec/numerics.md, BB7' 'no section or case BB7'
plant include/a.hpp '// the remainder (case BB7)' 'no case BB7'
plant include/a.hpp '// docs/spec/nothing.md says why' 'there is no docs/spec/nothing.md'
plant include/a.hpp '// as the method\n// sheet has it' 'not in the repository'
plant include/a.hpp '// a known trap A7' 'not in the repository'
plant include/a.hpp '// see DESIGN' 'not in the repository'
plant README.md '[nowhere](docs/none.md)' 'leads nowhere'
plant README.md 'as `tests/none.test.cpp` shows' 'there is no tests/none.test.cpp'
plant README.md 'see `include/{a,b}.hpp`' 'there is no include/b.hpp'
plant README.md 'see `docs/none/*.md`' 'there is no docs/none/\*.md'
plant README.md '[no heading](docs/spec/method.md#45-none)' 'no heading #45-none'
echo "negative control: $planted planted faults were seen"
[ "$bad" -eq 0 ]
