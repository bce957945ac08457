// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Puts the soft binding that `certify` writes into a manifest of C2PA, signs it, and reads the picture again, all by
// the reference implementation (c2pa-rs, as the npm package @contentauth/c2pa-wasm):
//  node c2pa.mjs <node_modules> <soft_binding.cbor> <picture.png> <leaf.der> <authority.der> <key.pem> [control]
// Prints what was read, as JSON. Exit status 1: it was refused, and why is on stderr. <control> spoils something:
// `blocks` makes a text of the assertion's, `picture` changes the signed picture.
import { createPrivateKey, sign } from "node:crypto";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

const [modules, binding, picture, leaf, authority, key, control] = process.argv.slice(2);
const folder = join(modules, "@contentauth/c2pa-wasm/pkg");
const c2pa = await import(pathToFileURL(join(folder, "c2pa.js")));
await c2pa.default({ module_or_path: readFileSync(join(folder, "c2pa_bg.wasm")) });

/// The part of CBOR that an assertion has: text, bytes, small numbers, lists, maps, null.
function decoded(bytes) {
  let at = 0;
  const number = (few) => {
    if (few < 24) return few;
    const width = 1 << (few - 24);
    let value = 0;
    for (let i = 0; i < width; ++i) value = value * 256 + bytes[at++];
    return value;
  };
  const item = () => {
    const head = bytes[at++], kind = head >> 5, few = head & 31;
    if (head === 0xf6) return null;
    const count = number(few);
    if (kind === 0) return count;
    if (kind === 2) return bytes.subarray(at, (at += count));
    if (kind === 3) return new TextDecoder().decode(bytes.subarray(at, (at += count)));
    if (kind === 4) return Array.from({ length: count }, item);
    if (kind === 5) return Object.fromEntries(Array.from({ length: count }, () => [item(), item()]));
    throw new Error(`CBOR: a head of ${head}`);
  };
  const value = item();
  if (at !== bytes.length) throw new Error("CBOR: bytes after the end");
  return value;
}

// COSE_Sign1 (RFC 9052) over the claim, which is not repeated in it: ES256, and the chain of certificates.
const head = (kind, count) => {
  if (count < 24) return [(kind << 5) | count];
  if (count < 256) return [(kind << 5) | 24, count];
  if (count < 65536) return [(kind << 5) | 25, count >> 8, count & 255];
  return [(kind << 5) | 26, count >>> 24, (count >>> 16) & 255, (count >>> 8) & 255, count & 255];
};
const text = (value) => [...head(3, value.length), ...new TextEncoder().encode(value)];
const data = (value) => Buffer.concat([Buffer.from(head(2, value.length)), value]);
const list = (...items) => Buffer.concat([Buffer.from(head(4, items.length)), ...items]);
const protectedHead = Buffer.concat([Buffer.from([0xa2, 0x01, 0x26, 0x18, 33]), list(data(readFileSync(leaf)), data(readFileSync(authority)))]);
const reserve = 4096;
const signer = {
  alg: "es256",
  reserveSize: reserve,
  async sign(claim) {
    const signed = list(Buffer.from(text("Signature1")), data(protectedHead), data(Buffer.alloc(0)), data(Buffer.from(claim)));
    const signature = sign("sha256", signed, { key: createPrivateKey(readFileSync(key)), dsaEncoding: "ieee-p1363" });
    const padded = (count) => Buffer.concat([Buffer.from([0xd2]), list(data(protectedHead),
      Buffer.concat([Buffer.from([0xa1]), Buffer.from(text("pad")), data(Buffer.alloc(count))]), Buffer.from([0xf6]), data(signature))]);
    return new Uint8Array(padded(300 + reserve - padded(300).length));
  },
};

const assertion = decoded(readFileSync(binding));
// The builder takes JSON, which has no bytes: a pad of none is left out.
if (assertion.pad?.length === 0) delete assertion.pad;
if (control === "blocks") assertion.blocks = "none";
// The package is made for a worker of a browser, which reads a file piece by piece.
class Held extends Blob {
  constructor(bytes, type) {
    super([bytes], { type });
    this.bytes = bytes;
  }
  slice(begin, end) {
    return new Held(this.bytes.subarray(begin, end), this.type);
  }
}
globalThis.FileReaderSync = class {
  readAsArrayBuffer(held) {
    return new Uint8Array(held.bytes).buffer;
  }
};
const source = new Held(readFileSync(picture), "image/png");
const builder = c2pa.WasmBuilder.fromJson(JSON.stringify({
  claim_generator_info: [{ name: "compmark test", version: "1" }],
  assertions: [{ label: "c2pa.actions.v2", data: { actions: [{ action: "c2pa.created", digitalSourceType: "http://c2pa.org/digitalsourcetype/empty" }, { action: "c2pa.watermarked.bound" }] } }],
}));
builder.addAssertion("c2pa.soft-binding", assertion);
const manifested = await builder.sign(signer, [], "image/png", source);
if (control === "picture") manifested[manifested.length - 40] ^= 1;
const reader = await c2pa.WasmReader.fromBytes("image/png", manifested);
const store = JSON.parse(reader.json());
const manifest = store.manifests[store.active_manifest];
const found = manifest.assertions.filter((one) => one.label.startsWith("c2pa.soft-binding"));
console.log(JSON.stringify({ found, state: store.validation_state, problems: (store.validation_status ?? []).map((one) => one.code) }));
