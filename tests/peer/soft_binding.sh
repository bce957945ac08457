#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# The soft binding that `certify` writes, put into a signed manifest of C2PA and read again by the reference
# implementation (c2pa-rs, as an npm package): it knows the assertion, and the manifest is valid. Where it, or
# the picture, is spoilt it must not be.
#   soft_binding.sh <the tool>
# npm says where its packages are, or COMPMARK_NODE_MODULES does.
set -eu
tool=$1 here=$(cd "$(dirname "$0")" && pwd)
golden=$here/../golden/marked weights=$here/../../weights
command -v node >/dev/null 2>&1 || { echo "skipped: no node is installed (Debian: nodejs, npm)"; exit 77; }
command -v openssl >/dev/null 2>&1 || { echo "skipped: no openssl is installed"; exit 77; }
modules=${COMPMARK_NODE_MODULES:-$(npm root -g 2>/dev/null || true)}
[ -f "$modules/@contentauth/c2pa-wasm/package.json" ] || { echo "skipped: no C2PA (npm install -g @contentauth/c2pa-wasm)"; exit 77; }
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cd "$scratch"

# Ends with 3, since nobody claimed this key: the record is written all the same.
"$tool" certify --model "$golden/hac.cmk" --key "$golden/owner.key" --decoder "$weights/lattice_32.safetensors" \
  --alpha 1e-3 --split all --out record >said.txt 2>&1 || [ $? -eq 3 ] || { cat said.txt; exit 1; }
"$tool" render --model "$golden/hac.cmk" --out pictures >said.txt 2>&1 || { cat said.txt; exit 1; }
picture=$(ls pictures/*.png | head -n 1)

# An authority and a signer of its own, whom no list trusts.
{
  openssl ecparam -name prime256v1 -genkey -noout -out authority.key
  openssl req -x509 -new -key authority.key -days 2 -subj "/O=CompMark test/CN=authority" -out authority.pem \
    -addext "basicConstraints=critical,CA:TRUE" -addext "keyUsage=critical,keyCertSign,cRLSign"
  openssl ecparam -name prime256v1 -genkey -noout | openssl pkcs8 -topk8 -nocrypt -out leaf.key
  openssl req -new -key leaf.key -subj "/O=CompMark test/CN=signer" -out leaf.csr
  printf 'basicConstraints=critical,CA:FALSE\nkeyUsage=critical,digitalSignature\nextendedKeyUsage=emailProtection\nsubjectKeyIdentifier=hash\nauthorityKeyIdentifier=keyid\n' >extensions
  openssl x509 -req -in leaf.csr -CA authority.pem -CAkey authority.key -CAcreateserial -days 2 -extfile extensions -out leaf.pem
  openssl x509 -in leaf.pem -outform DER -out leaf.der
  openssl x509 -in authority.pem -outform DER -out authority.der
} >openssl.txt 2>&1 || { cat openssl.txt; exit 1; }

manifested() { node "$here/soft_binding/c2pa.mjs" "$modules" record/soft_binding.cbor "$picture" leaf.der authority.der leaf.key "$@"; }
manifested >read.json 2>errors.txt || { cat errors.txt; exit 1; }
cat read.json
node --input-type=module -e '
  import assert from "node:assert";
  import { readFileSync } from "node:fs";
  const read = JSON.parse(readFileSync("read.json", "utf8")), record = JSON.parse(readFileSync("record/record.json", "utf8"));
  const bits = /"hex": *"([0-9a-f]+)"/.exec(JSON.stringify(record, null, 1))[1];
  assert.equal(read.state, "Valid");
  assert.deepEqual(read.problems, ["signingCredential.untrusted"]);
  assert.equal(read.found.length, 1);
  assert.equal(read.found[0].label, "c2pa.soft-binding");
  assert.equal(read.found[0].data.alg, "org.compmark.lattice-32.32");
  assert.deepEqual(read.found[0].data.blocks, [{ scope: {}, value: bits }]);
'
for control in blocks picture; do
  if manifested $control >read.json 2>errors.txt && grep -q '"Valid"' read.json; then
    echo "what was spoilt ($control) passed: $(cat read.json)"
    exit 1
  fi
done
