#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
"""Trains a message decoder that belongs to no scene (kind carrier) from marks that are learned by gradient, as a scene learns them.

There is no encoder. A slot holds a surface (two photographs side by side, its right end joined to its left), a key (a rotation of the outputs), a
message and a change of the surface, which is smoother than the surface, in some slots more than in others. At each visit a camera of its own looks at a
part of the changed surface, whole or cut out as an object on a ground; the view goes through drawn edits and is brought to the reading size; one
backward pass moves the weights and the change. The change keeps a root mean square over what is seen. So every view of a slot must say the message by
itself, as every view of a scene must. Unmarked pictures take part in every batch: their outputs are pulled to mean 0 and covariance 1, and a running
whitening does the rest, so that a logit is in deviations of what pictures say by themselves. The schedule is driven by time.

--from FILE goes on from a decoder file (as to_safetensors.py writes it): its convolutions, its statistics and its whitened linear map.
A file `total` in --out, written while the training runs, sets the length of the whole schedule anew.

Needs PyTorch, Pillow and NumPy. --images: a folder of square .jpg, all of one size, or an .npz with train and held [n, side, side, 3] (--pack makes one).
"""
import argparse, contextlib, json, math, os, re, struct, time
import numpy as np, torch, torch.nn as nn, torch.nn.functional as F

p = argparse.ArgumentParser()
p.add_argument("--images", required=True)
p.add_argument("--out", default="run")
p.add_argument("--pack", default="", help="write the split pictures to this .npz and stop")
p.add_argument("--seconds", type=float, default=60, help="of this call")
p.add_argument("--total", type=float, default=0, help="of the whole schedule; 0: as --seconds")
p.add_argument("--max-steps", type=int, default=0)
p.add_argument("--dimension", type=int, default=64)
p.add_argument("--layers", default="64/3/1 64/3/1t 96/3/2 96/3/1t 160/3/2 160/3/1 320/1/1t", help="channels/kernel/stride, t: averaged into the features")
p.add_argument("--reading-size", type=int, default=256)
p.add_argument("--sizes", default="256x256 256x256 320x320 320x320 384x384 224x224 192x256 256x192")
p.add_argument("--canvas", type=int, default=256)
p.add_argument("--changes", default="160 128 96 64", help="heights of the changes, one a quarter of the groups, enlarged to the canvas: splats have no sharper ones")
p.add_argument("--from", dest="origin", default="", help="a decoder file to go on from")
p.add_argument("--warm", action="store_true", help="edits at once, of more than half their strength: for weights that read already")
p.add_argument("--marked", type=int, default=192)
p.add_argument("--plain", type=int, default=64)
p.add_argument("--groups", type=int, default=32, help="of slots; four are visited in a step")
p.add_argument("--life", type=int, default=96, help="visits of a slot until it gets another picture and message")
p.add_argument("--lr", type=float, default=1.5e-3)
p.add_argument("--rise", type=int, default=200, help="steps until the learning rate is full")
p.add_argument("--rms0", type=float, default=0.08)
p.add_argument("--rms1", type=float, default=0.010)
p.add_argument("--margin", type=float, default=2.5)
p.add_argument("--white", type=float, default=0.3)
p.add_argument("--grey", type=float, default=0.2)
p.add_argument("--edited", type=float, default=0.85, help="share of the pictures that are edited")
p.add_argument("--seed", type=int, default=1)
p.add_argument("--report", type=float, default=10, help="seconds between lines of the log")
p.add_argument("--save", type=float, default=120, help="seconds between files")
p.add_argument("--evaluate", type=int, default=0, help="pictures")
p.add_argument("--visits", type=int, default=0, help="of marks that are tried on held-out surfaces before and after the training")
p.add_argument("--evaluate-steps", type=int, default=120)
p.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
a = p.parse_args()
a.total = a.total or a.seconds
dev = torch.device(a.device)
amp = dev.type == "cuda"
cast = (lambda: torch.autocast("cuda", torch.bfloat16)) if amp else contextlib.nullcontext
torch.manual_seed(a.seed)
torch.backends.cudnn.benchmark = True
torch.backends.cuda.matmul.allow_tf32 = True
torch.backends.cudnn.allow_tf32 = True
os.makedirs(a.out, exist_ok=True)
D = a.dimension
MEAN = torch.tensor([0.485, 0.456, 0.406], device=dev).view(1, 3, 1, 1)
DEV = torch.tensor([0.229, 0.224, 0.225], device=dev).view(1, 3, 1, 1)


# ---- pictures -------------------------------------------------------------------------------------------------------
def held_out(names, share=0.2):
    """Names of the photographs kept out, by the rule of mark/pretrain/photograph_split.hpp: pieces of one photograph stay together."""
    M = (1 << 64) - 1

    def stage(s):
        h = 14695981039346656037
        for c in s.encode(): h = ((h ^ c) * 1099511628211) & M
        return h

    def mix(x):
        x = (x + 0x9E3779B97F4A7C15) & M
        x = ((x ^ (x >> 30)) * 0xBF58476D1CE4E5B9) & M
        x = ((x ^ (x >> 27)) * 0x94D049BB133111EB) & M
        return x ^ (x >> 31)

    order = sorted({(mix(stage(g)), g) for g in map(group_of, names)})
    return {g for _, g in order[:int(max(1.0, share * len(order) + 0.5))]}


def group_of(name):
    return re.sub(r"_\d+$", "", os.path.splitext(name)[0])


def load(source):
    if source.endswith(".npz"):
        d = np.load(source)
        return d["train"], d["held"]
    from PIL import Image
    names = sorted(f for f in os.listdir(source) if f.endswith(".jpg"))
    out = held_out(names)
    read = lambda some: np.stack([np.asarray(Image.open(os.path.join(source, f)).convert("RGB")) for f in some])
    return read([f for f in names if group_of(f) not in out]), read([f for f in names if group_of(f) in out])


def uniform(n, lo, hi):
    return torch.empty(n, device=dev).uniform_(lo, hi)


def coin(n, q):
    return (torch.rand(n, device=dev) < q).float()


def per(v):
    return v.view(-1, 1, 1, 1)


def grid(size, zoom, angle, shift, shear, tilt, squeeze=None, aspect=1.0, bulge=None):
    """Where each pixel of a view [H, W] looks on its picture; zoom > 1 comes nearer; aspect: width over height of the view; bulge: of a round surface."""
    H, W = size
    gy, gx = torch.meshgrid(torch.linspace(-1 + 1 / H, 1 - 1 / H, H, device=dev), torch.linspace(-1 + 1 / W, 1 - 1 / W, W, device=dev), indexing="ij")
    r = math.sqrt(aspect)
    gx, gy = (gx * r).unsqueeze(0), (gy / r).unsqueeze(0)
    c, s = (v.view(-1, 1, 1) for v in (torch.cos(angle), torch.sin(angle)))
    z = zoom.view(-1, 1, 1) * (1 + tilt[:, 0].view(-1, 1, 1) * gx + tilt[:, 1].view(-1, 1, 1) * gy)
    X, Y = c * gx - s * gy + shear.view(-1, 1, 1) * gy, s * gx + c * gy
    if squeeze is not None: X = X * squeeze.view(-1, 1, 1)
    if bulge is not None: X = X * (1 + bulge.view(-1, 1, 1) * gx * gx)
    return torch.stack([X / z + shift[:, 0].view(-1, 1, 1), Y / z + shift[:, 1].view(-1, 1, 1)], -1)


def look(x, g, mode="zeros"):
    return F.grid_sample(x, g, mode="bilinear", padding_mode=mode, align_corners=False)


LUMA = torch.tensor([0.299, 0.587, 0.114], device=dev)
YIQ = torch.tensor([[0.299, 0.587, 0.114], [0.596, -0.274, -0.322], [0.211, -0.523, 0.312]], device=dev)
RGB = torch.inverse(YIQ)


def tone(x, gain, white, contrast, saturation, hue, gamma):
    """gain [n], white [n, 3], contrast, saturation, hue (radians), gamma [n]: one matrix a picture, then a power."""
    n = len(x)
    turn = torch.zeros(n, 3, 3, device=dev)
    c, s = torch.cos(hue) * saturation, torch.sin(hue) * saturation
    turn[:, 0, 0] = 1
    turn[:, 1, 1], turn[:, 1, 2], turn[:, 2, 1], turn[:, 2, 2] = c, -s, s, c
    m = (RGB @ turn @ YIQ) * (gain.view(-1, 1) * white).unsqueeze(1) * contrast.view(-1, 1, 1)
    middle = (x.detach().mean((1, 2, 3)) * gain * (1 - contrast)).view(-1, 1, 1)
    y = torch.baddbmm(middle.expand(n, 3, 1), m, x.flatten(2)).view_as(x)
    return y.clamp(1e-4, 1) ** per(gamma)


def photographs(bank, n, S, near=0.65):
    """Drawn pieces of photographs, in drawn tones: x [n, 3, S, S]"""
    x = bank[torch.randint(len(bank), (n,), device=dev)].float().div_(255)
    zoom = torch.exp(uniform(n, 0.0, near))
    room = (1 - 1 / zoom).view(-1, 1) * (2 * torch.rand(n, 2, device=dev) - 1)
    g = grid((S, S), zoom, uniform(n, -0.2, 0.2), room, torch.zeros(n, device=dev), torch.zeros(n, 2, device=dev))
    g[..., 0] *= (1 - 2 * coin(n, 0.5)).view(-1, 1, 1)
    x = look(x, g, "reflection")
    k = coin(n, 0.7)
    flat = torch.where(torch.rand(n, device=dev) < 0.12, uniform(n, 0.25, 0.7), torch.ones(n, device=dev))
    x = tone(x, 1 + k * uniform(n, -.3, .2), 1 + k.view(-1, 1) * (0.16 * torch.rand(n, 3, device=dev) - 0.08), (1 + k * uniform(n, -.35, .2)) * flat, 1 + k * uniform(n, -.5, .4), k * uniform(n, -.3, .3), torch.exp(k * uniform(n, -.25, .25)))
    soft = per(coin(n, 0.4))                                                    # renders are softer than photographs
    x = soft * F.avg_pool2d(F.pad(x, (1, 1, 1, 1), mode="replicate"), 3, 1) + (1 - soft) * x
    mix = per(coin(n, 0.1) * uniform(n, 0.2, 0.6))
    return (1 - mix) * x + mix * x.roll(1, 0)


def areas(n):
    """Shares of a picture that its object takes; 1: there is no ground."""
    return torch.where(torch.rand(n, device=dev) < 0.4, torch.ones(n, device=dev), torch.exp(uniform(n, math.log(0.1), math.log(0.7))))


def grounds(n):
    kind = torch.rand(n, 1, device=dev)
    plain = torch.rand(n, 3, device=dev)
    return torch.where(kind < 0.35, torch.ones_like(plain), torch.where(kind < 0.7, torch.zeros_like(plain), plain))


def silhouettes(area, size):
    """Objects of about these shares of the picture: mask [n, 1, H, W]; area of 1 and more: everywhere."""
    n, (H, W) = len(area), size
    rough = F.interpolate(torch.randn(n, 1, 5, 5, device=dev), size=size, mode="bicubic", align_corners=False)
    yy, xx = torch.meshgrid(torch.linspace(-1, 1, H, device=dev), torch.linspace(-1, 1, W, device=dev), indexing="ij")
    wide = per(torch.exp(uniform(n, -.35, .35)))
    shape = per(area * (4 / math.pi)) - ((xx * wide + per(uniform(n, -.25, .25))) ** 2 + (yy / wide + per(uniform(n, -.25, .25))) ** 2)
    shape = shape + per(uniform(n, 0.1, 0.6) * area.clamp(max=1).sqrt()) * rough + per((area >= 1).float() * 100)
    return torch.sigmoid(shape * 40)


def unmarked(bank, n, S):
    return torch.lerp(grounds(n).view(-1, 3, 1, 1), photographs(bank, n, S), silhouettes(areas(n), (S, S)))


COS = torch.tensor([[math.sqrt((1 if k == 0 else 2) / 8) * math.cos((2 * n + 1) * k * math.pi / 16) for n in range(8)] for k in range(8)], device=dev)
QY = torch.tensor([16,11,10,16,24,40,51,61,12,12,14,19,26,58,60,55,14,13,16,24,40,57,69,56,14,17,22,29,51,87,80,62,18,22,37,56,68,109,103,77,24,35,55,64,81,104,113,92,49,64,78,87,103,121,120,101,72,92,95,98,112,100,103,99.], device=dev).view(8, 8)
QC = torch.tensor([17,18,24,47,99,99,99,99,18,21,26,66,99,99,99,99,24,26,56,99,99,99,99,99,47,66,99,99,99,99,99,99] + [99.] * 32, device=dev).view(8, 8)
TO_YCC = torch.tensor([[.299, .587, .114], [-.168736, -.331264, .5], [.5, -.418688, -.081312]], device=dev)
TO_RGB = torch.inverse(TO_YCC)


class Coefficient(torch.autograd.Function):
    """Rounds; backwards, what is rounded to 0 passes little."""
    @staticmethod
    def forward(c, k):
        c.save_for_backward(k)
        return k.round()

    @staticmethod
    def backward(c, g):
        k, = c.saved_tensors
        return k.abs().mul_(2).clamp_(max=1).square_().mul_(g)


def jpeg(x, quality, subsample):
    """JPEG of [0,1] with the standard's tables; quality [n]. Backwards, a coefficient that is rounded to 0 passes little: what JPEG removes is no place for a mark."""
    n, _, H, W = x.shape
    pad_h, pad_w = -H % 16, -W % 16
    if pad_h or pad_w: x = F.pad(x, (0, pad_w, 0, pad_h), mode="replicate")
    y = (TO_YCC @ (x.flatten(2) * 255)).view_as(x)
    s = torch.where(quality < 50, 5000 / quality, 200 - 2 * quality)

    def code(c, table, zero):
        b, m, h, w = c.shape
        t = torch.floor((table * s.view(-1, 1, 1, 1, 1, 1) + 50) / 100).clamp(1, 255)
        k = (c - zero).view(b, m, h // 8, 8, w // 8, 8).permute(0, 1, 2, 4, 3, 5)
        k = COS.t() @ (Coefficient.apply(COS @ k @ COS.t() / t) * t) @ COS
        return k.permute(0, 1, 2, 4, 3, 5).reshape(b, m, h, w) + zero

    luma = code(y[:, :1], QY, 128.0)
    if subsample:
        chroma = F.interpolate(code(F.avg_pool2d(y[:, 1:], 2), QC, 0.0), scale_factor=2, mode="bilinear", align_corners=False)
    else:
        chroma = code(y[:, 1:], QC, 0.0)
    y = torch.cat([luma, chroma], 1)
    return ((TO_RGB @ y.flatten(2)).view_as(y) / 255)[:, :, :H, :W].clamp(0, 1)


def levels(x, steps=255.0):
    """Rounded values; the gradient passes, but not where a value is beyond the range."""
    y = x.clamp(0, 1)
    y.data.mul_(steps).round_().div_(steps)
    return y


def blur(x, sigma):
    n = max(1, int(math.ceil(2.5 * sigma)))
    t = torch.arange(-n, n + 1, device=dev).float()
    k = torch.exp(-t * t / (2 * sigma * sigma + 1e-8))
    k = (k / k.sum()).view(1, 1, 1, -1).expand(3, 1, 1, -1)
    x = F.conv2d(F.pad(x, (n, n, 0, 0), mode="replicate"), k, groups=3)
    return F.conv2d(F.pad(x, (0, 0, n, n), mode="replicate"), k.transpose(2, 3), groups=3)


def resize(x, size):
    return x if tuple(x.shape[2:]) == tuple(size) else F.interpolate(x, size=size, mode="bilinear", align_corners=False, antialias=size[0] < x.shape[2])


def reading(x):
    """Every picture at one size: its larger side is the reading size."""
    H, W = x.shape[2:]
    f = a.reading_size / max(H, W)
    return resize(x, (max(1, round(H * f)), max(1, round(W * f))))


def some(x, share, edit):
    """Applies `edit` to a drawn run of the pictures, which goes on at the start where the end is reached; their order is drawn once a batch."""
    n = len(x)
    k = int(round(n * share))
    if k == 0: return x
    first = int(torch.randint(n, (1,)))
    over = first + k - n
    if over <= 0:
        left, middle, right = x.split([first, k, n - first - k])
        return torch.cat([left, edit(middle), right])
    left, middle, right = x.split([over, n - k, k - over])
    left, right = edit(torch.cat([left, right])).split([over, k - over])
    return torch.cat([left, middle, right])


def edits(x, s, share=0.85):
    """A drawn chain of edits of strength s in [0, 1], for the first part of the pictures, so large a share."""
    k = int(round(len(x) * share))
    y, rest = x.split([k, len(x) - k])
    r = lambda: torch.rand(1).item()

    def geometry(v):
        m = len(v)
        zoom = torch.exp(uniform(m, -0.3, 0.6) * s)
        room = ((1 - 1 / zoom).clamp(min=0).view(-1, 1) + 0.12 * s) * (2 * torch.rand(m, 2, device=dev) - 1)
        turned = coin(m, 0.7)
        g = grid(v.shape[2:], zoom, turned * uniform(m, -0.6, 0.6) * s, room, turned * uniform(m, -0.15, 0.15) * s, turned.view(-1, 1) * (0.2 * torch.rand(m, 2, device=dev) - 0.1) * s)
        ground = per(torch.rand(m, device=dev)).expand(m, 3, 1, 1) if r() < 0.6 else torch.rand(m, 3, 1, 1, device=dev)
        w = look(torch.ones_like(v[:, :1]), g)
        return look(v, g) + (1 - w) * ground.round() if r() < 0.5 else look(v, g) + (1 - w) * ground

    def colours(v):
        m = len(v)
        grey = coin(m, a.grey / (share * 0.6)) if s > 0.2 else 0.0
        k = coin(m, 0.8)
        sat = (1 + k * uniform(m, -.8, .5) * s) * (1 - grey)
        return tone(v, torch.exp(k * uniform(m, -.5, .4) * s), 1 + k.view(-1, 1) * (0.3 * torch.rand(m, 3, device=dev) - 0.15) * s, torch.exp(k * uniform(m, -.4, .35) * s), sat, k * uniform(m, -.35, .35) * s, torch.exp(k * uniform(m, -.4, .4) * s))

    def softer(v):
        b = blur(v, 0.4 + 1.9 * s * r())
        return v + per(torch.where(torch.rand(len(v), device=dev) < 0.75, torch.ones(len(v), device=dev), -uniform(len(v), 0.3, 1.0) * s)) * (b - v)

    def resampled(v):
        f = math.exp(-1.0 * s * r())
        return resize(resize(v, (max(16, round(v.shape[2] * f)), max(16, round(v.shape[3] * f)))), v.shape[2:])

    def covered(v):
        hole = F.interpolate(torch.randn(len(v), 1, 4, 4, device=dev), size=v.shape[2:], mode="bilinear", align_corners=False) > 1.0 - 0.4 * s
        return torch.where(hole, v.detach().roll(1, 0), v)

    def noisy(v):
        return v + per(uniform(len(v), 0, 0.13) * s) * torch.randn_like(v)

    def coded(v):
        return jpeg(v.clamp(0, 1), torch.empty(len(v), device=dev).uniform_(95 - 65 * s, 96), r() < 0.7)

    y = some(y, 0.5, geometry)
    y = some(y, 0.6, colours)
    if r() < 0.6: y = some(y, 0.5, softer)
    if r() < 0.5: y = some(y, 0.5, resampled)
    if s > 0.2: y = some(y, 0.1, covered)
    y = some(y, 0.4, noisy)
    if s > 0.2: y = some(y, 0.05, lambda v: levels(v, float(2 ** int(4 + 3 * r()) - 1)))
    y = some(y, 0.35 + 0.1 * s, coded)
    if r() < 0.25: y = some(y, 0.3, coded)                                      # saved twice
    return levels(torch.cat([y, rest]))


# ---- the decoder ----------------------------------------------------------------------------------------------------
class Block(nn.Module):
    def __init__(s, i, o, kernel, stride):
        super().__init__()
        s.conv = nn.Conv2d(i, o, kernel, stride, kernel // 2)
        s.bn = nn.BatchNorm2d(o, eps=1e-3, momentum=0.03)

    def forward(s, x):
        return F.gelu(s.bn(s.conv(x)))


class Decoder(nn.Module):
    """[0,1] RGB -> outputs. Pixel unshuffle by 4 (c, dy, dx); blocks; means over positions of the tapped ones; linear."""
    def __init__(s, layers, dimension):
        super().__init__()
        s.blocks, s.taps, i, total = nn.ModuleList(), [], 48, 0
        for layer in layers.split():
            o, kernel, stride = (int(v) for v in layer.rstrip("t").split("/"))
            s.blocks.append(Block(i, o, kernel, stride))
            s.taps.append(layer.endswith("t"))
            total += o * s.taps[-1]
            i = o
        s.linear = nn.Linear(total, dimension)

    def forward(s, x):
        x = (x - MEAN) / DEV
        H, W = x.shape[2:]
        if H % 4 or W % 4: x = F.pad(x, (0, -W % 4, 0, -H % 4), mode="replicate")
        x = F.pixel_unshuffle(x, 4)
        if amp: x = x.contiguous(memory_format=torch.channels_last)
        means = []
        for block, tap in zip(s.blocks, s.taps):
            x = block(x)
            if tap: means.append(x.float().mean((2, 3)))
        with torch.autocast(dev.type, enabled=False):
            return s.linear(torch.cat(means, 1))


# ---- slots ----------------------------------------------------------------------------------------------------------
LENGTHS = torch.tensor([D // 2, 3 * D // 4, 3 * D // 4, D], device=dev)


class Slots:
    """Groups of surfaces whose change is kept between visits. A surface is twice as wide as a view is at zoom 1."""
    def __init__(s, bank, groups, size, sides):
        s.bank, s.size, s.per_side = bank, size, groups // len(sides)
        n, S = groups * size, a.canvas
        s.x = torch.zeros(n, 3, S, 2 * S, device=dev, dtype=torch.float16 if amp else torch.float32)
        s.d = [torch.zeros(s.per_side * size, 3, c, 2 * c, device=dev) for c in sides]
        s.pull = [torch.zeros_like(d) for d in s.d]
        s.ground, s.area, s.loud, s.roll = torch.zeros(n, 3, device=dev), torch.ones(n, device=dev), torch.ones(n, device=dev), torch.zeros(n, device=dev)
        s.m, s.used = torch.zeros(n, D, device=dev), torch.zeros(n, D, device=dev)
        s.key = torch.zeros(n, dtype=torch.long, device=dev)
        s.age, s.visits = [0] * groups, [0] * groups                                # visits: of a life that began in its middle, how many there were
        s.keys = torch.linalg.qr(torch.randn(512, D, D, device=dev))[0]
        for g in range(groups):
            s.fresh(g)
            s.age[g] = int(a.life * (g // s.per_side + g % s.per_side / s.per_side) / len(sides)) % a.life                       # all ages in every step

    def part(s, g):
        return slice(g * s.size, (g + 1) * s.size)

    def place(s, g):
        """Which tensor of changes holds a group, and where in it."""
        return g // s.per_side, s.part(g % s.per_side)

    @torch.no_grad()
    def fresh(s, g):
        q, n = s.part(g), s.size
        x = photographs(s.bank, 2 * n, a.canvas, 0.3)
        s.x[q] = torch.cat([x[:n], x[n:]], 3).to(s.x.dtype)
        s.ground[q] = grounds(n)
        s.area[q] = areas(n)
        s.roll[q] = coin(n, 0.2)
        k, at = s.place(g)
        s.d[k][at] = 0
        s.pull[k][at] = 0
        s.m[q] = 2 * (torch.rand(n, D, device=dev) < 0.5).float() - 1
        bits = LENGTHS[torch.randint(4, (n,), device=dev)]
        s.used[q] = (torch.arange(D, device=dev).view(1, -1) < bits.view(-1, 1)).float() * (D / bits.view(-1, 1))
        s.key[q] = torch.randint(len(s.keys), (n,), device=dev)
        s.loud[q] = torch.exp(uniform(n, -0.4, 0.4)) / s.area[q].sqrt()
        s.age[g] = s.visits[g] = 0

    def view(s, groups, changes, size):
        """The groups' changed surfaces as a camera of its own sees each; a far camera sees a smaller object."""
        q = torch.cat([torch.arange(s.part(g).start, s.part(g).stop, device=dev) for g in groups])
        n = len(q)
        area, free = s.area[q], s.roll[q] > 0
        whole = area >= 1
        zoom = torch.exp(torch.where(whole, uniform(n, 0.0, 0.7), uniform(n, -0.4, 0.4)))
        angle = torch.where(free, uniform(n, -3.14, 3.14), uniform(n, -0.35, 0.35))
        up = torch.where(whole, 1 - 1 / zoom, torch.full_like(zoom, 0.3)) * uniform(n, -1, 1)
        g = grid(size, zoom, angle, torch.stack([uniform(n, -2, 2), up], 1), uniform(n, -.2, .2), 0.5 * torch.rand(n, 2, device=dev) - 0.25, torch.exp(uniform(n, -0.1, 0.4)), size[1] / size[0], uniform(n, 0, 0.5))
        g = torch.stack([torch.remainder(g[..., 0] * 0.5 + 1, 2) - 1, g[..., 1]], -1)
        with torch.no_grad():
            x = look(torch.cat([s.x[s.part(k)] for k in groups]).float(), g, "reflection")
            mask = silhouettes(torch.where(whole, area, (area * zoom * zoom * torch.exp(uniform(n, -.2, .2))).clamp(0.05, 0.9)), size)
        d = torch.cat([look(c, part, "reflection") for c, part in zip(changes, g.split(s.size))])
        return q, torch.lerp(s.ground[q].view(-1, 3, 1, 1), x + d, mask).clamp(0, 1)

    @torch.no_grad()
    def move(s, groups, changes, rms, late):
        """One step of the changes down their gradient, within their strength over the surface; late in a life the steps are small."""
        for g, d in zip(groups, changes):
            k, at = s.place(g)
            step = d.grad / (d.grad.square().mean((1, 2, 3), keepdim=True).sqrt() + 1e-12)
            pull = s.pull[k][at].mul_(0.7).add_(step, alpha=0.3)
            cap = per(rms * s.loud[s.part(g)])
            e = d.detach() - 0.4 * (1 - 0.85 * late(g)) * cap * pull
            e = e * (cap / (e.square().mean((1, 2, 3), keepdim=True).sqrt() + 1e-9)).clamp(max=1)
            s.d[k][at] = e.clamp(-6 * cap, 6 * cap)

    def changes(s, groups):
        out = []
        for g in groups:
            k, at = s.place(g)
            out.append(s.d[k][at].detach().clone().requires_grad_(True))
        return out

    def logits(s, q, y, mu, W):
        return torch.bmm(s.keys[s.key[q]], ((y - mu) @ W).unsqueeze(2)).squeeze(2) * s.m[q]


# ---- training -------------------------------------------------------------------------------------------------------
train_pictures, held_pictures = load(a.images)
if a.pack:
    np.savez(a.pack, train=train_pictures, held=held_pictures)
    print(a.pack, train_pictures.shape, held_pictures.shape)
    raise SystemExit
to_bank = lambda v: torch.from_numpy(v).to(dev).permute(0, 3, 1, 2).contiguous()
bank, held = to_bank(train_pictures), to_bank(held_pictures)
net = Decoder(a.layers, D).to(dev)


def from_file(path):
    """Blocks and linear map of a decoder file; the convolutions' F16 becomes F32."""
    with open(path, "rb") as f: head = json.loads(f.read(struct.unpack("<Q", f.read(8))[0])); blob = f.read()
    def tensor(k):
        v = head[k]
        return torch.from_numpy(np.frombuffer(blob[v["data_offsets"][0]:v["data_offsets"][1]], {"F16": "<f2", "F32": "<f4"}[v["dtype"]]).astype(np.float32).reshape(v["shape"]))
    out = {k: tensor(k) for k in head if k.startswith("blocks.")}
    out.update({"linear.weight": tensor("whiten.weight"), "linear.bias": tensor("whiten.bias")})
    out.update({k: v for k, v in net.state_dict().items() if k.endswith("num_batches_tracked")})
    return out


if a.origin: net.load_state_dict(from_file(a.origin))
if amp: net = net.to(memory_format=torch.channels_last)
opt = torch.optim.AdamW(net.parameters(), lr=a.lr, weight_decay=1e-4, betas=(0.9, 0.98), **({"fused": True} if amp else {}))
state = {"step": 0, "elapsed": 0.0, "clean": 0.5, "edited": 0.5, "taken_off": -1.0}
I = torch.eye(D, device=dev)


def whitening(cov):
    """The symmetric inverse root; directions that pictures hardly move are not blown up without a bound."""
    ev, V = torch.linalg.eigh(cov.double())
    return ((V / (ev.clamp(min=0) + 2e-3 * ev[-1]).sqrt()) @ V.t()).float()


with torch.no_grad():                                                           # outputs of about deviation 1 on unmarked pictures from the first step
    net.train(not a.origin)
    y = torch.cat([net(unmarked(bank, a.plain, a.reading_size)) for _ in range(1 + 1024 // a.plain if amp else 4)]).float()
    mean, spread = (torch.zeros(D, device=dev), torch.ones(D, device=dev)) if a.origin else (y.mean(0), y.std(0))
    net.linear.weight /= spread.unsqueeze(1)
    if not a.origin: net.linear.bias.zero_()
    y = (y - mean) / spread
    cov, offset, W = torch.cov(y.t()), y.mean(0), None
ema = {k: v.detach().clone() for k, v in net.state_dict().items()}
checkpoint = os.path.join(a.out, "checkpoint.pt")
if os.path.exists(checkpoint):
    ck = torch.load(checkpoint, map_location=dev)
    net.load_state_dict(ck["net"]); opt.load_state_dict(ck["opt"]); ema, state, cov, offset = ck["ema"], ck["state"], ck["cov"], ck["offset"]
    print("resumed", state, flush=True)
sides = [int(v) for v in a.changes.split()]
slots = Slots(bank, a.groups, a.marked // len(sides), sides)
sizes = [tuple(int(v) for v in s.split("x")) for s in a.sizes.split()]
begin, start_elapsed, log = time.time(), state["elapsed"], []
print(json.dumps({"parameters": sum(v.numel() for v in net.parameters()), "train": len(bank), "held": len(held), "torch": torch.__version__, "device": torch.cuda.get_device_name() if amp else "cpu"}), flush=True)


def save_log():
    with open(os.path.join(a.out, "log.json"), "w") as f: json.dump({"args": vars(a), "state": state, "log": log, "views": views}, f)


def save():
    torch.save({"net": net.state_dict(), "opt": opt.state_dict(), "ema": ema, "state": state, "cov": cov, "offset": offset}, checkpoint + ".new")
    os.replace(checkpoint + ".new", checkpoint)
    np.savez(os.path.join(a.out, "decoder.npz"), cov=cov.cpu().numpy(), offset=offset.cpu().numpy(), **{k: v.detach().float().cpu().numpy() for k, v in ema.items()})
    save_log()


def in_views(rms, visits, edited):
    """Marks surfaces of held-out photographs with the decoder as it stands, as a scene is marked, and reads them from other views: share of right bits
    of 48, of views with more than 40 right, and the mean margin, before and after edits."""
    was = net.training
    net.eval()
    with torch.no_grad():
        y = []
        for _ in range(8 if amp else 1):
            with cast(): y.append(net(reading(unmarked(bank, 256, a.canvas))).float())
        y = torch.cat(y)
        mu, W = y.mean(0), whitening(torch.cov(y.t()))
    some_slots = Slots(held, 2 * len(sides), 24 if amp else 2, sides)
    some_slots.used[:] = (torch.arange(D, device=dev) < 3 * D // 4).float()
    some_slots.loud[:] = 1 / some_slots.area.sqrt()
    groups = list(range(2 * len(sides)))
    for visit in range(visits):
        changes = some_slots.changes(groups)
        q, seen = some_slots.view(groups, changes, (256, 256))
        seen = edits(seen, 1.0) if edited else levels(seen)
        with cast(): y = net(reading(seen)).float()
        z = some_slots.logits(q, y, mu, W)
        (F.relu(a.margin - z).square() * some_slots.used[q]).mean().backward()
        some_slots.move(groups, changes, rms, lambda g: visit / visits)
    row = {}
    with torch.no_grad():
        for name in ("clean", "edited"):
            read = []
            for _ in range(4):
                q, seen = some_slots.view(groups, some_slots.changes(groups), (320, 320))
                with cast(): y = net(reading(levels(seen) if name == "clean" else edits(seen, 1.0, 1.0))).float()
                read.append(some_slots.logits(q, y, mu, W)[:, :3 * D // 4])
            z = torch.cat(read)
            right = (z > 0).float().mean(1)
            row[name] = [round(v.item(), 4) for v in (right.mean(), (right > 40.5 / 48).float().mean(), z.mean())]
            small = torch.cat([some_slots.area < 0.25] * 4)
            row[name].append(round(right[small].mean().item(), 4))
    net.train(was)
    for v in net.parameters(): v.grad = None
    return row


def report_views(which):
    rows = {f"rms {rms}{', edits while marking' if edited else ''}": in_views(rms, a.visits, edited) for rms, edited in ((0.01, False), (0.0075, True))}
    print(json.dumps({"views": which, **rows}), flush=True)
    return rows


views = {}
if a.visits and state["step"] == 0: views["before"] = report_views("before")
begin = time.time()
last_line, last_save, window = time.time(), time.time(), time.time()
window_steps = 0
while time.time() - begin < a.seconds and state["elapsed"] < a.total and (a.max_steps == 0 or state["step"] < a.max_steps):
    state["elapsed"] = start_elapsed + time.time() - begin
    if state["step"] % 50 == 0 and os.path.exists(os.path.join(a.out, "total")):
        with open(os.path.join(a.out, "total")) as f: a.total = float(f.read().strip() or a.total)
    t, step = min(1.0, state["elapsed"] / a.total), state["step"]
    for g in opt.param_groups: g["lr"] = a.lr * min(1, (step + 1) / a.rise) * (0.5 * (1 + math.cos(math.pi * t)) * 0.98 + 0.02)
    if a.warm:
        s = t / 0.75
        strength = min(1.0, 0.6 + 4 * t)
    else:
        if state["taken_off"] < 0 and (state["clean"] > 0.95 or t > 0.12): state["taken_off"] = t
        s = 0.0 if state["taken_off"] < 0 else min(1.0, (t - state["taken_off"]) / (0.80 - state["taken_off"]))  # 0 at take-off, 1 at 80 % of the time: nothing may stop this clock
        strength = min(1.0, 2.5 * s)
    rms = a.rms0 * (a.rms1 / a.rms0) ** min(1.0, max(0.0, (s - 0.1) / 0.9))
    net.train(t < 0.9)
    groups = [k * slots.per_side + step % slots.per_side for k in range(len(sides))]
    for g in groups:
        if slots.age[g] >= a.life: slots.fresh(g)
    size = sizes[torch.randint(len(sizes), (1,)).item()]
    changes = slots.changes(groups)
    q, seen = slots.view(groups, changes, size)
    with torch.no_grad():
        x = resize(unmarked(bank, a.plain, a.canvas), size)
    order = torch.randperm(len(q) + a.plain, device=dev)
    every = torch.cat([seen, x])[order]
    every = edits(every, strength, a.edited) if strength > 0 else levels(every)
    with cast():
        y = net(reading(every)).float()[order.argsort()]
    y, plain = y[:len(q)], y[len(q):]
    if W is None or step % 10 == 0: W = whitening(cov)
    z = slots.logits(q, y, offset, W)
    seen_so_far = torch.cat([torch.full((slots.size,), float(slots.visits[g]), device=dev) for g in groups])
    grown = seen_so_far > 0.5 * a.life
    known = (seen_so_far / 16).clamp(0.05, 1)                                             # a change that was begun just now says nothing yet
    miss = (F.relu(a.margin - z).square() / a.margin ** 2 * slots.used[q]).mean(1) * known
    loss_m = 0.5 * miss.mean() + 0.5 * (miss.square().mean() + 1e-12).sqrt()      # the second looks at pictures that read badly
    centred = plain - plain.mean(0)
    with torch.no_grad():
        k = 0.03 if step > 100 else 0.1
        offset.lerp_(plain.mean(0), k)
        cov.lerp_(centred.t() @ centred / (len(plain) - 1), k)
    loss_w = (((cov - I) / D) * (centred.t() @ centred / (len(plain) - 1))).sum() + 2 * (offset * plain.mean(0)).mean()
    loss = loss_m + a.white * loss_w
    opt.zero_grad(set_to_none=True)
    loss.backward()
    slots.move(groups, changes, rms, lambda g: min(1.0, slots.age[g] / a.life))
    for g in groups:
        slots.age[g] += 1
        slots.visits[g] += 1
    torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
    opt.step()
    if step % 5 == 0:
        with torch.no_grad():
            for k, v in net.state_dict().items():
                if v.is_floating_point(): ema[k].lerp_(v, 0.01 if t > 0.3 else 0.1)
                else: ema[k].copy_(v)
    state["step"] += 1
    window_steps += 1
    if step % 10 == 0:
        with torch.no_grad():
            right = ((z > 0).float() * (slots.used[q] > 0)).sum(1) / (slots.used[q] > 0).sum(1)
            now = (right * grown).sum() / grown.sum().clamp(min=1)
            if grown.any(): state["edited" if strength > 0 else "clean"] += 0.15 * (now.item() - state["edited" if strength > 0 else "clean"])
        if not math.isfinite(loss.item()): raise SystemExit("loss is not finite")
    if time.time() - last_line > a.report:
        last_line = time.time()
        line = {"t": round(state["elapsed"], 1), "step": state["step"], "rate": round(window_steps / (last_line - window), 1), "loss": round(loss_m.item(), 4), "white": round((cov - I).square().mean().sqrt().item() * math.sqrt(D), 3), "deviation": round(cov.diagonal().mean().sqrt().item(), 3), "clean": round(state["clean"], 4), "edited": round(state["edited"], 4), "rms": round(rms, 4), "strength": round(strength, 2), "z": round(z[grown].mean().item() if grown.any() else 0, 2)}
        window, window_steps = last_line, 0
        log.append(line); print(json.dumps(line), flush=True)
    if time.time() - last_save > a.save:
        last_save = time.time(); save()
state["elapsed"] = start_elapsed + time.time() - begin
save()

# ---- evaluation on photographs that were not trained on --------------------------------------------------------------
net.load_state_dict(ema)
net.eval()
if a.visits:
    views["after"] = report_views("after")
    save_log()
with torch.no_grad():
    stats = []
    for _ in range(32 if amp else 4):
        with cast(): stats.append(net(unmarked(bank, 256 if amp else 32, a.canvas)).float())
    stats = torch.cat(stats).double()
    mu, co = stats.mean(0), torch.cov(stats.t())
    ev, V = torch.linalg.eigh(co)
    W = (V / ev.clamp(min=1e-6 * ev[-1].item()).sqrt()).t().float()
    np.savez(os.path.join(a.out, "whitening.npz"), mu=mu.cpu().numpy(), cov=co.cpu().numpy())
    print("eigenvalues of the outputs on unmarked pictures", round(ev[0].item(), 4), round(ev[-1].item(), 4), flush=True)
if a.evaluate:
    B = min(a.evaluate, len(held))
    one, zero, two = torch.ones(B, device=dev), torch.zeros(B, device=dev), torch.zeros(B, 2, device=dev)
    ones3 = torch.ones(B, 3, device=dev)

    def attack(name, v):
        S = v.shape[-1]
        word, number = re.match(r"([a-z]+)([\d.]*)", name).groups()
        number = float(number or 0)
        if word == "none": return v
        if word == "noise": return v + number * torch.randn_like(v)
        if word == "rotation": return look(v, grid((S, S), one, one * math.radians(number), two, zero, two))
        if word == "scale": return resize(v, (int(S * number), int(S * number)))
        if word == "crop":
            n = int(S * math.sqrt(number)); o = (S - n) // 2
            return v[:, :, o:o + n, o:o + n]
        if word == "blur": return blur(v, number)
        if word == "jpeg": return jpeg(v, number * one, True)
        if word == "gain": return v * number
        if word == "gamma": return v.clamp(1e-4, 1) ** number
        if word == "hue": return tone(v, one, ones3, one, one, one * math.radians(number), one)
        if word == "saturation": return tone(v, one, ones3, one, one * number, zero, one)
        if word == "grey": return tone(v, one, ones3, one, zero, zero, one)
        if word == "social": return tone(jpeg(resize(v, (int(S * .6), int(S * .6))), 70 * one, True), one, ones3, one, 1.15 * one, zero, one)
        raise KeyError(name)

    names = "none noise0.05 noise0.1 rotation15 rotation30 scale0.75 scale0.5 scale1.5 blur1 blur2 crop0.4 jpeg75 jpeg50 jpeg30 gain0.7 gain1.3 gamma0.8 gamma1.25 hue10 saturation0.7 grey social".split()
    result = {}
    S = 320
    x = resize(held[torch.linspace(0, len(held) - 1, B).long().to(dev)].float() / 255, (S, S))
    yy, xx = torch.meshgrid(torch.linspace(-1, 1, S, device=dev), torch.linspace(-1, 1, S, device=dev), indexing="ij")
    disc = torch.sigmoid((0.4 - xx ** 2 - yy ** 2) * 40).view(1, 1, S, S)
    for kind, mask in (("photographs", torch.ones(1, 1, S, S, device=dev)), ("objects on white", disc)):
        base = mask * x + (1 - mask)
        for rms in (0.0126, 0.0079):
            d = torch.zeros(B, 3, sides[0] * S // a.canvas, sides[0] * S // a.canvas, device=dev)
            key = torch.linalg.qr(torch.randn(B, D, D, device=dev))[0][:, :3 * D // 4]
            m = 2 * (torch.rand(B, 3 * D // 4, device=dev) < 0.5).float() - 1

            def logits(v):
                with cast(): y = net(reading(v)).float()
                return torch.bmm(key, ((y - mu.float()) @ W.t()).unsqueeze(2)).squeeze(2)

            full = lambda d: F.interpolate(d, size=(S, S), mode="bilinear", align_corners=False) * mask
            for it in range(a.evaluate_steps):
                d.requires_grad_(True)
                z = logits(edits((base + full(d)).clamp(0, 1), 0.8))
                gr, = torch.autograd.grad(F.relu(a.margin - m * z).square().mean(), d)
                d = d.detach() - 0.2 * rms * (1 - 0.8 * it / a.evaluate_steps) * gr / (gr.square().mean((1, 2, 3), keepdim=True).sqrt() + 1e-12)
                d = d * (rms / (full(d).square().mean((1, 2, 3), keepdim=True).sqrt() + 1e-9)).clamp(max=1)
            with torch.no_grad():
                v = levels((base + full(d)).clamp(0, 1))
                row = {}
                for name in names:
                    z = logits(levels(attack(name, v)))
                    row[name] = round(((z * m) > 0).float().mean().item(), 4)
                row["mean margin"] = round((logits(v) * m).mean().item(), 3)
                row["unmarked deviation"] = round(logits(base).std().item(), 3)
                result[f"{kind}, {-20 * math.log10((v - base).square().mean().sqrt().item()):.1f} dB"] = row
    with open(os.path.join(a.out, "evaluation.json"), "w") as f: json.dump(result, f, indent=1)
    for k, v in result.items(): print(k, json.dumps(v), flush=True)
