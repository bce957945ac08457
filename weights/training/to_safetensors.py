#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
"""decoder.npz and whitening.npz of train_universal.py -> a decoder file of kind carrier: all directions, whitened. Convolutions are stored as F16.
The middle of a picture is read too (middle); the mean of two readings spreads less on unmarked pictures, by SCALE, which the whitening takes back.
usage: to_safetensors.py RUN OUT [NOTE]"""
import json, os, struct, sys, numpy as np

run, out = sys.argv[1:3]
note = sys.argv[3] if len(sys.argv) > 3 else "trained from random weights on photographs, marks learned by gradient under edits"
d, w = np.load(os.path.join(run, "decoder.npz")), np.load(os.path.join(run, "whitening.npz"))
args = json.load(open(os.path.join(run, "log.json")))["args"]
MIDDLE, SCALE = "0.8", 1.088                                                    # rms of 64 logits of 300 photographs: 1.247 from one reading, 1.147 from the mean of two
ev, V = np.linalg.eigh(w["cov"].astype(np.float64))
W = (V / np.sqrt(ev)) @ V.T                                                     # the symmetric root: the outputs keep their places
tensors, layers = {}, []
for n, layer in enumerate(args["layers"].split()):
    channels, kernel, stride = layer.rstrip("t").split("/")
    for k in ("conv.weight", "conv.bias", "bn.weight", "bn.bias", "bn.running_mean", "bn.running_var"):
        tensors[f"blocks.{n}.{k}"] = d[f"blocks.{n}.{k}"]
    layers.append(f"{kernel}/{stride}/{int(kernel) // 2}" + ("t" if layer.endswith("t") else ""))
tensors["whiten.weight"] = SCALE * W @ d["linear.weight"].astype(np.float64)
tensors["whiten.bias"] = SCALE * W @ (d["linear.bias"].astype(np.float64) - w["mu"])
meta = dict(format="compmark decoder", format_version="1", kind="carrier", bits="0", width=args["layers"].split("/")[0], depth=str(len(layers) - 1), stem="4", activation="gelu",
            norm_epsilon="0.001", logit_scale="1.6", haar_levels="0", largest_side=str(args["reading_size"]), smallest_side=str(args["reading_size"]), reads="subject", middle=MIDDLE, input_gain="1", input_mean="0.485 0.456 0.406",
            input_deviation="0.229 0.224 0.225", layers=" ".join(layers), note=note)
head, blob = {"__metadata__": meta}, b""
for k, v in tensors.items():
    kind = "F16" if k.endswith("conv.weight") else "F32"
    v = np.ascontiguousarray(v, dtype="<f2" if kind == "F16" else "<f4")
    assert np.isfinite(v).all(), k
    head[k] = {"dtype": kind, "shape": list(v.shape), "data_offsets": [len(blob), len(blob) + v.nbytes]}
    blob += v.tobytes()
h = json.dumps(head).encode()
h += b" " * (-len(h) % 8)
with open(out, "wb") as f: f.write(struct.pack("<Q", len(h)) + h + blob)
print(out, len(h) + 8 + len(blob), "bytes", meta["layers"])
