#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
"""Trains a message decoder that belongs to no scene (kind carrier) from marks that are learned by gradient, as a scene learns them.

There is no encoder. A slot holds a photograph, a key (a rotation of the outputs), a message and a change of the picture. At each visit a camera of its
own looks at the changed picture, the view goes through drawn edits and is brought to the reading size; one backward pass moves the weights and the
change. The change keeps a root mean square over the whole picture. Unmarked pictures take part in every batch: their outputs are pulled to mean 0 and
covariance 1, and a running whitening does the rest, so that a logit is in deviations of what pictures say by themselves. The schedule is driven by time.

Needs PyTorch, Pillow and NumPy. --images: a folder of square .jpg, all of one size, or an .npz with train and held [n, side, side, 3] (--pack makes one).
"""
import argparse, contextlib, json, math, os, re, time
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
p.add_argument("--change", type=int, default=160, help="side of a change, which is enlarged to the canvas: splats have no sharper one")
p.add_argument("--marked", type=int, default=192)
p.add_argument("--plain", type=int, default=64)
p.add_argument("--groups", type=int, default=32, help="of slots; four are visited in a step")
p.add_argument("--life", type=int, default=64, help="visits of a slot until it gets another picture and message")
p.add_argument("--lr", type=float, default=1.5e-3)
p.add_argument("--rms0", type=float, default=0.08)
p.add_argument("--rms1", type=float, default=0.010)
p.add_argument("--margin", type=float, default=2.5)
p.add_argument("--white", type=float, default=0.3)
p.add_argument("--grey", type=float, default=0.2)
p.add_argument("--seed", type=int, default=1)
p.add_argument("--report", type=float, default=10, help="seconds between lines of the log")
p.add_argument("--save", type=float, default=120, help="seconds between files")
p.add_argument("--evaluate", type=int, default=0, help="pictures")
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


def grid(size, zoom, angle, shift, shear, tilt, squeeze=None, aspect=1.0):
    """Where each pixel of a view [H, W] looks on its picture; zoom > 1 comes nearer; aspect: width over height of the view."""
    H, W = size
    gy, gx = torch.meshgrid(torch.linspace(-1 + 1 / H, 1 - 1 / H, H, device=dev), torch.linspace(-1 + 1 / W, 1 - 1 / W, W, device=dev), indexing="ij")
    r = math.sqrt(aspect)
    gx, gy = (gx * r).unsqueeze(0), (gy / r).unsqueeze(0)
    c, s = (v.view(-1, 1, 1) for v in (torch.cos(angle), torch.sin(angle)))
    z = zoom.view(-1, 1, 1) * (1 + tilt[:, 0].view(-1, 1, 1) * gx + tilt[:, 1].view(-1, 1, 1) * gy)
    X, Y = c * gx - s * gy + shear.view(-1, 1, 1) * gy, s * gx + c * gy
    if squeeze is not None: X = X * squeeze.view(-1, 1, 1)
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


def photographs(bank, n, S):
    """Drawn pieces of photographs and a mask of where a mark may be: everywhere, or an object on a ground. -> x [n,3,S,S], mask [n,1,S,S], ground [n,3]"""
    x = bank[torch.randint(len(bank), (n,), device=dev)].float().div_(255)
    zoom = torch.exp(uniform(n, 0.0, 0.65))
    room = (1 - 1 / zoom).view(-1, 1) * (2 * torch.rand(n, 2, device=dev) - 1)
    g = grid((S, S), zoom, uniform(n, -0.2, 0.2), room, torch.zeros(n, device=dev), torch.zeros(n, 2, device=dev))
    g[..., 0] *= (1 - 2 * coin(n, 0.5)).view(-1, 1, 1)
    x = look(x, g, "reflection")
    k = coin(n, 0.7)
    x = tone(x, 1 + k * uniform(n, -.3, .2), 1 + k.view(-1, 1) * (0.16 * torch.rand(n, 3, device=dev) - 0.08), 1 + k * uniform(n, -.35, .2), 1 + k * uniform(n, -.5, .4), k * uniform(n, -.3, .3), torch.exp(k * uniform(n, -.25, .25)))
    soft = per(coin(n, 0.4))                                                    # renders are softer than photographs
    x = soft * F.avg_pool2d(F.pad(x, (1, 1, 1, 1), mode="replicate"), 3, 1) + (1 - soft) * x
    mix = per(coin(n, 0.1) * uniform(n, 0.2, 0.6))
    x = (1 - mix) * x + mix * x.roll(1, 0)
    rough = F.interpolate(torch.randn(n, 1, 5, 5, device=dev), size=(S, S), mode="bicubic", align_corners=False)
    yy, xx = torch.meshgrid(torch.linspace(-1, 1, S, device=dev), torch.linspace(-1, 1, S, device=dev), indexing="ij")
    round_ = per(uniform(n, 0.25, 0.8)) - ((xx * per(uniform(n, 0.8, 1.4)) + per(uniform(n, -.3, .3))) ** 2 + (yy * per(uniform(n, 0.8, 1.4)) + per(uniform(n, -.3, .3))) ** 2)
    shape = round_ + per(uniform(n, 0.1, 0.6)) * rough
    mask = torch.sigmoid(shape * 40)
    whole = per(coin(n, 0.5))
    mask = whole + (1 - whole) * mask
    plain = torch.rand(n, 3, device=dev)
    kind = torch.rand(n, 1, device=dev)
    plain = torch.where(kind < 0.35, torch.ones_like(plain), torch.where(kind < 0.65, torch.zeros_like(plain), plain))
    return x, mask, plain


COS = torch.tensor([[math.sqrt((1 if k == 0 else 2) / 8) * math.cos((2 * n + 1) * k * math.pi / 16) for n in range(8)] for k in range(8)], device=dev)
QY = torch.tensor([16,11,10,16,24,40,51,61,12,12,14,19,26,58,60,55,14,13,16,24,40,57,69,56,14,17,22,29,51,87,80,62,18,22,37,56,68,109,103,77,24,35,55,64,81,104,113,92,49,64,78,87,103,121,120,101,72,92,95,98,112,100,103,99.], device=dev).view(8, 8)
QC = torch.tensor([17,18,24,47,99,99,99,99,18,21,26,66,99,99,99,99,24,26,56,99,99,99,99,99,47,66,99,99,99,99,99,99] + [99.] * 32, device=dev).view(8, 8)
TO_YCC = torch.tensor([[.299, .587, .114], [-.168736, -.331264, .5], [.5, -.418688, -.081312]], device=dev)
TO_RGB = torch.inverse(TO_YCC)


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
        k = COS @ k @ COS.t() / t
        through = k * (2 * k.detach().abs()).clamp(max=1).square()
        k = through + (torch.round(k) - through).detach()
        k = COS.t() @ (k * t) @ COS
        return k.permute(0, 1, 2, 4, 3, 5).reshape(b, m, h, w) + zero

    luma = code(y[:, :1], QY, 128.0)
    if subsample:
        chroma = F.interpolate(code(F.avg_pool2d(y[:, 1:], 2), QC, 0.0), scale_factor=2, mode="bilinear", align_corners=False)
    else:
        chroma = code(y[:, 1:], QC, 0.0)
    y = torch.cat([luma, chroma], 1)
    return ((TO_RGB @ y.flatten(2)).view_as(y) / 255)[:, :, :H, :W].clamp(0, 1)


def levels(x, steps=255.0):
    x = x.clamp(0, 1)
    return x + (torch.round(x * steps) / steps - x).detach()


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
    """Applies `edit` to a drawn share of the pictures."""
    n = len(x)
    k = int(round(n * share))
    if k == 0: return x
    order = torch.randperm(n, device=dev)
    changed = edit(x.index_select(0, order[:k]))
    return x.index_copy(0, order[:k], changed.to(x.dtype))


def edits(x, s, share=0.85):
    """A drawn chain of edits of strength s in [0, 1], for a drawn share of the pictures."""
    n = len(x)
    order = torch.randperm(n, device=dev)
    k = int(round(n * share))
    y = x.index_select(0, order[:k])
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
    return levels(x.index_copy(0, order[:k], y))


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
class Slots:
    """Groups of pictures whose change is kept between visits."""
    def __init__(s, bank, groups, size):
        s.bank, s.size = bank, size
        n, S, C = groups * size, a.canvas, a.change
        s.x = torch.zeros(n, 4, S, S, device=dev, dtype=torch.float16 if amp else torch.float32)
        s.ground = torch.zeros(n, 3, device=dev)
        s.d = torch.zeros(n, 3, C, C, device=dev)
        s.pull = torch.zeros_like(s.d)
        s.m = torch.zeros(n, D, device=dev)
        s.used = torch.zeros(n, D, device=dev)
        s.key = torch.zeros(n, dtype=torch.long, device=dev)
        s.loud = torch.ones(n, device=dev)
        s.age = [0] * groups
        s.keys = torch.linalg.qr(torch.randn(512, D, D, device=dev))[0]
        for g in range(groups):
            s.fresh(g)
            s.age[g] = int(a.life * (g // max(1, groups // 4) + g % max(1, groups // 4) / max(1, groups // 4)) / 4) % a.life     # all ages in every step

    def part(s, g):
        return slice(g * s.size, (g + 1) * s.size)

    @torch.no_grad()
    def fresh(s, g):
        q, n = s.part(g), s.size
        x, mask, ground = photographs(s.bank, n, a.canvas)
        s.x[q] = torch.cat([x, mask], 1).to(s.x.dtype)
        s.ground[q] = ground
        s.d[q] = 0
        s.pull[q] = 0
        s.m[q] = 2 * (torch.rand(n, D, device=dev) < 0.5).float() - 1
        bits = torch.tensor([D // 2, 3 * D // 4, 3 * D // 4, D], device=dev)[torch.randint(4, (n,), device=dev)]
        s.used[q] = (torch.arange(D, device=dev).view(1, -1) < bits.view(-1, 1)).float() * (D / bits.view(-1, 1))
        s.key[q] = torch.randint(len(s.keys), (n,), device=dev)
        s.loud[q] = torch.exp(uniform(n, -0.4, 0.4))
        s.age[g] = 0

    def view(s, q, d, size, much, objects):
        """The slots' changed pictures as a camera of its own sees each."""
        n = len(d)
        on = coin(n, 0.85) * much
        zoom = torch.exp(on * uniform(n, -0.45, 0.45))
        angle = on * torch.where(torch.rand(n, device=dev) < 0.15, uniform(n, -3.14, 3.14), uniform(n, -0.5, 0.5))
        shift = on.view(-1, 1) * (0.5 * torch.rand(n, 2, device=dev) - 0.25)
        g = grid(size, zoom, angle, shift, on * uniform(n, -.25, .25), on.view(-1, 1) * (0.5 * torch.rand(n, 2, device=dev) - 0.25), torch.exp(on * uniform(n, -0.1, 0.5)), size[1] / size[0])
        with torch.no_grad():
            x = look(s.x[q].float(), g, "reflection")
            x, mask = x[:, :3], x[:, 3:]
            if not objects: mask = torch.ones_like(mask)
        return mask * (x + look(d, g, "reflection")) + (1 - mask) * s.ground[q].view(-1, 3, 1, 1)

    @torch.no_grad()
    def move(s, q, grad, rms, late):
        """One step of the changes down their gradient, within their strength over the whole picture; late in a life the steps are small."""
        weight = F.interpolate(s.x[q][:, 3:].float(), size=grad.shape[2:], mode="bilinear", align_corners=False)
        step = grad * weight
        step = step / (step.square().mean((1, 2, 3), keepdim=True).sqrt() + 1e-12)
        pull = s.pull[q].mul_(0.6).add_(step, alpha=0.4)
        cap = per(rms * s.loud[q])
        d = s.d[q] - per(0.4 * (1 - 0.85 * late)) * cap * pull
        size = (d * weight).square().mean((1, 2, 3), keepdim=True).sqrt()
        s.d[q] = (d * (cap / (size + 1e-9)).clamp(max=1)).clamp(-6 * cap, 6 * cap)


# ---- training -------------------------------------------------------------------------------------------------------
train_pictures, held_pictures = load(a.images)
if a.pack:
    np.savez(a.pack, train=train_pictures, held=held_pictures)
    print(a.pack, train_pictures.shape, held_pictures.shape)
    raise SystemExit
to_bank = lambda v: torch.from_numpy(v).to(dev).permute(0, 3, 1, 2).contiguous()
bank, held = to_bank(train_pictures), to_bank(held_pictures)
net = Decoder(a.layers, D).to(dev)
if amp: net = net.to(memory_format=torch.channels_last)
opt = torch.optim.AdamW(net.parameters(), lr=a.lr, weight_decay=1e-4, betas=(0.9, 0.98), **({"fused": True} if amp else {}))
state = {"step": 0, "elapsed": 0.0, "clean": 0.5, "edited": 0.5, "taken_off": -1.0}
I = torch.eye(D, device=dev)


def whitening(cov):
    """The symmetric inverse root; directions that pictures hardly move are not blown up without a bound."""
    ev, V = torch.linalg.eigh(cov.double())
    return ((V / (ev.clamp(min=0) + 2e-3 * ev[-1]).sqrt()) @ V.t()).float()


with torch.no_grad():                                                           # outputs of about deviation 1 on unmarked pictures from the first step
    net.train()
    y = torch.cat([net(m * x + (1 - m) * g.view(-1, 3, 1, 1)) for x, m, g in (photographs(bank, a.plain, a.reading_size) for _ in range(1 + 1024 // a.plain if amp else 4))]).float()
    y = y - y.mean(0)
    net.linear.weight /= y.std(0).unsqueeze(1)
    net.linear.bias.zero_()
    y = y / y.std(0)
    cov, offset, W = y.t() @ y / (len(y) - 1), torch.zeros(D, device=dev), None
ema = {k: v.detach().clone() for k, v in net.state_dict().items()}
checkpoint = os.path.join(a.out, "checkpoint.pt")
if os.path.exists(checkpoint):
    ck = torch.load(checkpoint, map_location=dev)
    net.load_state_dict(ck["net"]); opt.load_state_dict(ck["opt"]); ema, state, cov, offset = ck["ema"], ck["state"], ck["cov"], ck["offset"]
    print("resumed", state, flush=True)
slots = Slots(bank, a.groups, a.marked // 4)
sizes = [tuple(int(v) for v in s.split("x")) for s in a.sizes.split()]
begin, start_elapsed, log = time.time(), state["elapsed"], []
print(json.dumps({"parameters": sum(v.numel() for v in net.parameters()), "train": len(bank), "held": len(held), "torch": torch.__version__, "device": torch.cuda.get_device_name() if amp else "cpu"}), flush=True)


def save():
    torch.save({"net": net.state_dict(), "opt": opt.state_dict(), "ema": ema, "state": state, "cov": cov, "offset": offset}, checkpoint)
    np.savez(os.path.join(a.out, "decoder.npz"), cov=cov.cpu().numpy(), offset=offset.cpu().numpy(), **{k: v.detach().float().cpu().numpy() for k, v in ema.items()})
    with open(os.path.join(a.out, "log.json"), "w") as f: json.dump({"args": vars(a), "state": state, "log": log}, f)


last_line, last_save, window = time.time(), time.time(), time.time()
window_steps = 0
while time.time() - begin < a.seconds and (a.max_steps == 0 or state["step"] < a.max_steps):
    state["elapsed"] = start_elapsed + time.time() - begin
    t, step = min(1.0, state["elapsed"] / a.total), state["step"]
    for g in opt.param_groups: g["lr"] = a.lr * min(1, (step + 1) / 200) * (0.5 * (1 + math.cos(math.pi * t)) * 0.98 + 0.02)
    if state["taken_off"] < 0 and (state["clean"] > 0.95 or t > 0.12): state["taken_off"] = t
    s = 0.0 if state["taken_off"] < 0 else min(1.0, (t - state["taken_off"]) / (0.80 - state["taken_off"]))      # 0 at take-off, 1 at 80 % of the time: nothing may stop this clock
    strength = min(1.0, 2.5 * s)
    rms = a.rms0 * (a.rms1 / a.rms0) ** min(1.0, max(0.0, (s - 0.1) / 0.9))
    net.train(t < 0.9)
    n = a.groups // 4
    groups = [(step + k * n) % n + k * n for k in range(4)] if a.groups >= 4 else [0]
    for g in groups:
        if slots.age[g] >= a.life: slots.fresh(g)
    q = torch.cat([torch.arange(slots.part(g).start, slots.part(g).stop) for g in groups]).to(dev)
    age = torch.cat([torch.full((slots.size,), float(slots.age[g])) for g in groups]).to(dev)
    size = sizes[torch.randint(len(sizes), (1,)).item()]
    d = slots.d[q].requires_grad_(True)
    seen = slots.view(q, d, size, strength, s > 0.05)
    with torch.no_grad():
        x, mask, ground = photographs(bank, a.plain, a.canvas)
        x = resize(mask * x + (1 - mask) * ground.view(-1, 3, 1, 1), size)
    every = torch.cat([seen, x])
    every = edits(every, strength) if strength > 0 else levels(every)
    with cast():
        y = net(reading(every)).float()
    y, plain = y[:len(q)], y[len(q):]
    if W is None or step % 10 == 0: W = whitening(cov)
    z = torch.bmm(slots.keys[slots.key[q]], ((y - offset) @ W).unsqueeze(2)).squeeze(2) * slots.m[q]
    known = (age / 8).clamp(0.05, 1).view(-1, 1)                                  # a change that was begun just now says nothing yet
    miss = F.relu(a.margin - z).square() / a.margin ** 2
    loss_m = (miss * slots.used[q] * known).mean()
    centred = plain - plain.mean(0)
    with torch.no_grad():
        k = 0.03 if step > 100 else 0.1
        offset.lerp_(plain.mean(0), k)
        cov.lerp_(centred.t() @ centred / (len(plain) - 1), k)
    loss_w = (((cov - I) / D) * (centred.t() @ centred / (len(plain) - 1))).sum() + 2 * (offset * plain.mean(0)).mean()
    loss = loss_m + a.white * loss_w
    opt.zero_grad(set_to_none=True)
    loss.backward()
    slots.move(q, d.grad, rms, (age / a.life).clamp(0, 1))
    for g in groups: slots.age[g] += 1
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
            grown = age > 0.5 * a.life
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
with torch.no_grad():
    stats = []
    for _ in range(32 if amp else 4):
        x, mask, ground = photographs(bank, 256 if amp else 32, a.canvas)
        with cast(): stats.append(net(mask * x + (1 - mask) * ground.view(-1, 3, 1, 1)).float())
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
            d = torch.zeros(B, 3, a.change * S // a.canvas, a.change * S // a.canvas, device=dev)
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
