#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# What is installed by a build that has the tool, and what its Debian packages hold:  run.sh <project root> <build folder>
# Nothing is compiled. A check whose program is missing (man, mandoc, zsh, fish, dpkg-deb) is left out, and said to be.
set -eu
root=$(cd "$1" && pwd)
build=$(cd "$2" && pwd)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
has() { command -v "$1" >/dev/null 2>&1 || { echo "not looked at: there is no $1" && false; }; }
fail() {
  echo "packaging: $*"
  exit 1
}
there() { for file in "$@"; do [ -s "$file" ] || fail "$file is missing"; done; }
same() { [ "$2" = "$3" ] || fail "$1: '$2', not '$3'"; }
value() { sed -n "s/^$1:[A-Z]*=//p" "$build/CMakeCache.txt"; }
# No installed file names a folder of this machine: the program does where it was told to look for its decoder in the source.
no_paths() {
  binaries=
  case $(value COMPMARK_WEIGHTS_DIR) in "$root"*) binaries=-I ;; esac
  if grep -rl $binaries -e "$root" -e "$build" "$1"; then fail "these files name folders of this machine"; fi
}

# Each component by itself.
for component in tool dev; do
  cmake --install "$build" --prefix "$scratch/$component" --component "compmark_$component" >/dev/null
  no_paths "$scratch/$component"
done
tool="$scratch/tool/bin/compmark"
share="$scratch/tool/share"
zsh_file="$scratch/tool/$(value COMPMARK_ZSH_COMPLETION_DIR)/_compmark"
fish_file="$share/fish/vendor_completions.d/compmark.fish"
bash_file="$share/bash-completion/completions/compmark"
there "$tool" "$share/compmark/weights/universal3_64.safetensors" "$zsh_file" "$fish_file" "$bash_file" "$scratch/dev/include/compmark/compmark.hpp" \
  "$scratch/dev/share/cmake/compmark/compmark-config.cmake" "$scratch/dev/share/pkgconfig/compmark.pc"
[ ! -e "$scratch/dev/bin" ] || fail "the library's component has programs"

# The version is told in one place, and twice where a file can't read it from there.
version=$("$tool" --version | awk '{ print $2 }')
same "version of vcpkg.json" "$(sed -n 's/.*"version": "\(.*\)".*/\1/p' "$root/packaging/vcpkg/compmark/vcpkg.json")" "$version"
same "version of compmark.pc" "$(sed -n 's/^Version: //p' "$scratch/dev/share/pkgconfig/compmark.pc")" "$version"

# The man page is well formed, and has every command and every option of it.
page=$(find "$share/man" -name 'compmark.1*')
case $page in
  *.gz) gzip -dc "$page" >"$scratch/compmark.1" ;;
  *) cp "$page" "$scratch/compmark.1" ;;
esac
if has man && has groff; then
  man --warnings -E UTF-8 -l -Tutf8 "$page" >"$scratch/page" 2>"$scratch/words" || fail "man fails: $(cat "$scratch/words")"
  [ ! -s "$scratch/words" ] || fail "man warns: $(cat "$scratch/words")"
fi
if has mandoc; then mandoc -Tlint "$scratch/compmark.1" || fail "mandoc warns"; fi
commands=$("$tool" --help | awk '/^Subcommands:/ { on = 1; next } on && /^  [a-z]/ { print $1 }')
[ "$(echo "$commands" | wc -l)" -gt 20 ] || fail "the tool has too few commands: $commands"
# <command> -> its options, one a line: of the tool, and of the page.
options_of() { "$tool" "$1" --help | sed -n 's/^  \(--[a-z0-9-]*\).*/\1/p' | grep -vx -e --help-all | sort; }
options_told() {
  sed 's/\\-/-/g' "$scratch/compmark.1" | awk -v command="$1" '
    /^\.S[SH]/ { on = $0 == ".SS " command; next }
    on && /^\\fB--/ { sub(/^\\fB/, ""); sub(/\\fR.*/, ""); print }' | sort
}
# offered <words...>: what the completion of bash offers for the last of them.
offered() {
  # shellcheck disable=SC2016 # bash's words
  bash -c '. "$1" && shift && COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) && _compmark compmark "${@: -1}" "${@: -2:1}"; echo "${COMPREPLY[@]}"' \
    bash "$bash_file" compmark "$@"
}
for command in $commands; do
  same "options of $command in the man page" "$(options_told "$command")" "$(options_of "$command")"
  grep -q "^complete -c compmark .* -a $command -d" "$fish_file" || fail "fish does not know $command"
  grep -q "^ *'$command:" "$zsh_file" || fail "zsh does not know $command"
  for option in $(options_of "$command"); do
    grep -q "from $command' .*-l ${option#--} " "$fish_file" || fail "fish does not know $command $option"
    awk -v command="$command" -v option="$option" '
      /^ +[a-z-]+\)$/ { on = $1 == command ")" }
      on && index($0, option "[") { found = 1 }
      END { exit !found }' "$zsh_file" || fail "zsh does not know $command $option"
  done
  if has bash; then
    case " $(offered '') " in *" $command "*) ;; *) fail "bash does not know $command" ;; esac
    same "bash for $command --" "$(offered "$command" -- | tr ' ' '\n' | grep -vx -e --help -e --help-all | sort)" "$(options_of "$command")"
  fi
done
if has bash; then
  same "bash for a choice" "$(offered verify --split t)" "test train"
  same "bash for a file" "$(offered verify --images t)" ""
fi
if has zsh; then zsh -n "$zsh_file"; fi
if has fish; then
  fish -n "$fish_file"
  same "fish for a choice" "$(fish -c "source $fish_file; complete -C 'compmark verify --split t'" | cut -f 1 | tr '\n' ' ')" "test train "
fi

# The packages.
if has dpkg-deb && has dpkg-shlibdeps; then
  (cd "$scratch" && cpack --config "$build/CPackConfig.cmake" -G DEB -B "$scratch/debs" >"$scratch/words" 2>&1) || fail "cpack fails: $(cat "$scratch/words")"
  for name in compmark libcompmark-dev; do
    package=$(find "$scratch/debs" -maxdepth 1 -name "${name}_${version}-*.deb")
    there "$package"
    dpkg-deb -x "$package" "$scratch/$name"
    no_paths "$scratch/$name"
    there "$scratch/$name/usr/share/doc/$name/copyright"
    same "version of $name" "$(dpkg-deb -f "$package" Version)" "$version-1"
    dpkg-deb -f "$package" Depends >"$scratch/$name.depends"
  done
  usr="$scratch/compmark/usr"
  there "$usr/bin/compmark" "$usr/share/compmark/weights/universal3_64.safetensors" "$usr/share/man/man1/$(basename "$page")" \
    "$usr/share/bash-completion/completions/compmark" "$scratch/libcompmark-dev/usr/include/compmark/compmark.hpp" \
    "$scratch/libcompmark-dev/usr/share/cmake/compmark/compmark-config.cmake"
  grep -q 'libc6 .*libstdc++6' "$scratch/compmark.depends" || fail "compmark depends on $(cat "$scratch/compmark.depends")"
  for needed in libeigen3-dev libnanoflann-dev libstb-dev nlohmann-json3-dev; do
    grep -q "$needed" "$scratch/libcompmark-dev.depends" || fail "libcompmark-dev does not depend on $needed"
  done
  # No file is in both.
  for name in compmark libcompmark-dev; do (cd "$scratch/$name" && find . -type f | sort >"$scratch/$name.files"); done
  same "files in both packages" "$(comm -12 "$scratch/compmark.files" "$scratch/libcompmark-dev.files")" ""
  same "the packed tool" "$("$usr/bin/compmark" --version)" "compmark $version"
  "$usr/bin/compmark" doctor | grep -q "$usr/share/compmark/weights" || fail "the packed tool does not find its decoder"
fi
echo "packaging: all is there"
