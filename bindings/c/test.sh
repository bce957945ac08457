#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# test.sh COMPILER LIBRARY SOURCE: compiles test.c as strict C99 against the library, and runs it; then looks at what the library shows.
set -eu
compiler=$1 library=$2 source=$3
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
lib=$(dirname "$library")
"$compiler" -std=c99 -Wall -Wextra -Wpedantic -Wconversion -Werror -I"$source/bindings/c" "$source/bindings/c/test.c" -o "$folder/interface" \
  -L"$lib" -lcompmark -lm -Wl,-rpath,"$lib"
# The header alone, by a C++ compiler's rules too.
printf '#include "compmark.h"\n#include "compmark.h"\nint main() { return compmark_abi() == 0; }\n' >"$folder/cpp.cpp"
c++ -Wall -Wextra -Wpedantic -Werror -I"$source/bindings/c" -fsyntax-only "$folder/cpp.cpp"
cd "$folder" # a path that is not there stays so
marked=$source/tests/golden/marked
decoder=$source/weights/lattice_32.safetensors
tool=$(dirname "$lib")/bin/compmark
"$tool" claim --key "$marked/owner.key" --decoder "$decoder" --out owner.claim >claim.txt
./interface "$marked/hac.cmk" "$marked/owner.key" "$decoder" owner.claim model.safetensors
# Without options the library says what the tool says, to the byte: with the decoder beside the model, with the shipped one, and of a key with a payload.
same() { # KEY MODEL WORDS: the report holds them
  status=0
  "$tool" verify --key "$1" --model "$2" --json tool.json >tool.txt 2>&1 || status=$?
  case $status in 0 | 1 | 3) ;; *) cat tool.txt; exit 1 ;; esac
  ./interface report "$1" "$2" >library.json
  cmp tool.json library.json || { diff tool.json library.json; exit 1; }
  grep -q "$3" library.json || { echo "the report of $2 has no $3"; cat library.json; exit 1; }
}
mkdir own plain
cp "$marked/hac.cmk" "$marked/owner.key" own
cp "$decoder" own/decoder.safetensors
cp "$marked/hac.cmk" plain
same own/owner.key own/hac.cmk '"matches": 28,'
same own/owner.key plain/hac.cmk '"file": "universal3_64.safetensors"' # the control: read with that, it is no mark of this decoder
grep -q '"matches": 28,' library.json && { echo "the control is read as the marked one"; exit 1; }
"$tool" keygen --quick --bits 48 --payload c0ff --out payload.key >key.txt
same payload.key plain/hac.cmk '"payload": {'
# A torn model, put back together in what stands in for its unmarked one: bits, p-value and anchors are the tool's, and others than those of the torn one.
"$tool" attack --model own/hac.cmk --attack feature_noise:0.3 --out own/unmarked.safetensors >attack.txt
"$tool" attack --model own/hac.cmk --attack prune:0.5 --out own/torn.safetensors >attack.txt
status=0
"$tool" verify --key own/owner.key --model own/torn.safetensors --unmarked own/unmarked.safetensors --restored --json tool.json >tool.txt 2>&1 || status=$?
case $status in 0 | 1 | 3) ;; *) cat tool.txt; exit 1 ;; esac
./interface restored own/owner.key own/torn.safetensors own/unmarked.safetensors >library.json
cmp tool.json library.json || { diff tool.json library.json; exit 1; }
grep -q '"restored": {' library.json && grep -q '"raised": [12]' library.json || { echo "nothing was restored"; cat library.json; exit 1; }
./interface report own/owner.key own/torn.safetensors >torn.json
[ "$(grep fused -A 3 torn.json)" != "$(grep fused -A 3 library.json)" ] || { echo "the torn model was read as it is"; exit 1; }
# The record of a key names its decoder: another is refused as the tool refuses it, unless any is allowed.
commitment=$(sed -n 's/.*"commitment": "\([0-9a-f]*\)".*/\1/p' own/owner.key)
printf '{"schema":"compmark.mark.1","key":{"id":"x","commitment":"%s"},"decoder":{"file":"f","sha256":"0","tensors_sha256":"0"},"models":[]}\n' "$commitment" >own/owner.key.record
status=0
"$tool" verify --key own/owner.key --model own/hac.cmk >tool.txt 2>&1 || status=$?
[ $status -eq 2 ] && grep -q "is not the decoder of this key's mark" tool.txt || { echo "the tool takes the record otherwise"; cat tool.txt; exit 1; }
status=0
./interface report own/owner.key own/hac.cmk >refused.txt || status=$?
[ $status -eq 2 ] && grep -q "decoder: is not the decoder of this key's mark.*set any_decoder" refused.txt || { echo "the record was not asked"; cat refused.txt; exit 1; }
./interface report-any own/owner.key own/hac.cmk >library.json
grep -q '"matches": 28,' library.json
# Nothing else is shown, so that it lives beside any other library of C++.
others=$(nm -D --defined-only "$library" | awk '{ print $3 }' | grep -v '^compmark_' || true)
[ -z "$others" ] || { echo "the library shows more than its functions: $others"; exit 1; }
declared=$(sed -n 's/^COMPMARK_API.*\(compmark_[a-z_]*\)(.*/\1/p' "$source/bindings/c/compmark.h" | sort)
shown=$(nm -D --defined-only "$library" | awk '{ print $3 }' | grep '^compmark_' | sort)
[ "$declared" = "$shown" ] || { echo "declared: $declared"; echo "shown: $shown"; exit 1; }
