#!/usr/bin/env python3
"""Writes networks.txt: what PyTorch's own modules compute, in double precision, for the networks of network_test.cc.

Needs python3-torch; the C++ test does not. Parameters, inputs and the gradient at the output are hashes of their index, so that
only results are kept: outputs, and every 29th number of the gradient by the parameters in the order of docs/networks.md.

    tests/policy/nn/golden/make_networks.py > tests/policy/nn/golden/networks.txt
"""

import torch
from torch import nn
from torch.nn import functional

BATCH, FRAME, STATE = 3, 15, 4
HEAD = 6
torch.set_default_dtype(torch.float64)


def numbers(count, scale, stream):
    """Evenly spread in +-scale by a hash of the index, the same in every language."""
    result = []
    for i in range(count):
        h = (i * 2654435761 + stream * 40503) % 2**32
        h = (h ^ h >> 15) * 2246822519 % 2**32
        h = (h ^ h >> 13) * 3266489917 % 2**32
        result.append(scale * (h / 2**31 - 1.0))
    return torch.tensor(result)


class TimeCnn(nn.Module):
    def __init__(self, history):
        super().__init__()
        self.first = nn.Conv1d(FRAME, 5, 3, padding=1)
        self.second = nn.Conv1d(5, 4, history)
        self.width = 4

    def slots(self):  # Ours have the frames of a window before the numbers of a frame.
        return [(p, [0, 2, 1] if p.dim() == 3 else None) for p in self.parameters()]

    def forward(self, x):
        x = functional.relu(self.first(x.transpose(1, 2)))
        return functional.relu(self.second(x)).flatten(1)


class BeamCnn(nn.Module):
    def __init__(self, history):
        super().__init__()
        ranges = FRAME - STATE
        self.first = nn.Conv1d(history, 4, 5, stride=2)
        self.second = nn.Conv1d(4, 3, 3, stride=2)
        self.positions = ((ranges - 5) // 2 + 1 - 3) // 2 + 1
        self.linear = nn.Linear(3 * self.positions + STATE * history, 5)
        self.width = 5

    def slots(self):
        return [(p, [0, 2, 1] if p.dim() == 3 else None) for p in self.parameters()]

    def forward(self, x):
        y = functional.relu(self.first(x[:, :, :FRAME - STATE]))
        y = functional.relu(self.second(y)).transpose(1, 2).flatten(1)  # Positions before channels.
        return functional.relu(self.linear(torch.cat([y, x[:, :, FRAME - STATE:].flatten(1)], 1)))


class Gru(nn.Module):
    def __init__(self, history):
        super().__init__()
        self.gru = nn.GRU(FRAME, 4, num_layers=2, batch_first=True)
        self.width = 4

    def slots(self):
        names = [f"{kind}_{source}_l{layer}" for layer in (0, 1) for source in ("ih", "hh") for kind in ("weight", "bias")]
        return [(getattr(self.gru, name), None) for name in names]

    def forward(self, x):
        return self.gru(x)[0][:, -1]


class Block(nn.Module):
    def __init__(self, width, heads):
        super().__init__()
        self.attention_norm = nn.LayerNorm(width)
        self.attention = nn.MultiheadAttention(width, heads, batch_first=True)
        self.mlp_norm = nn.LayerNorm(width)
        self.up = nn.Linear(width, 4 * width)
        self.down = nn.Linear(4 * width, width)

    def forward(self, x):
        y = self.attention_norm(x)
        later = torch.ones(x.shape[1], x.shape[1], dtype=torch.bool).triu(1)
        x = x + self.attention(y, y, y, attn_mask=later, need_weights=False)[0]
        return x + self.down(functional.gelu(self.up(self.mlp_norm(x)), approximate="tanh"))


class Transformer(nn.Module):
    def __init__(self, history):
        super().__init__()
        self.embedding = nn.Linear(FRAME, 8)
        self.time = nn.Parameter(torch.zeros(history, 8))
        self.embedding_norm = nn.LayerNorm(8)
        self.blocks = nn.ModuleList([Block(8, 2), Block(8, 2)])
        self.norm = nn.LayerNorm(8)
        self.width = 8

    def slots(self):
        ordered = [*self.embedding.parameters(), self.time, *self.embedding_norm.parameters()]
        for b in self.blocks:
            ordered += [*b.attention_norm.parameters(), b.attention.in_proj_weight, b.attention.in_proj_bias,
                        *b.attention.out_proj.parameters(), *b.mlp_norm.parameters(), *b.up.parameters(),
                        *b.down.parameters()]
        return [(p, None) for p in ordered + [*self.norm.parameters()]]

    def forward(self, x):
        x = self.embedding_norm(self.embedding(x) + self.time)
        for block in self.blocks:
            x = block(x)
        return self.norm(x)[:, -1]


def fill(slots, values):
    """Sets the parameters, one after the other, from numbers in our order."""
    at = 0
    for parameter, order in slots:
        shape = [parameter.shape[i] for i in order] if order else list(parameter.shape)
        ours = values[at:at + parameter.numel()].view(shape)
        parameter.data.copy_(ours.permute(order) if order else ours)
        at += parameter.numel()


def run(name, encoder, history):
    head = [nn.Linear(encoder.width + 2, HEAD), nn.Linear(HEAD, 3)]
    slots = encoder.slots() + [(p, None) for layer in head for p in layer.parameters()]
    count = sum(p.numel() for p, _ in slots)
    fill(slots, numbers(count, 0.6, 1))
    row = history * FRAME + 2
    data = numbers(BATCH * row, 1.0, 2).view(BATCH, row)
    features = encoder(data[:, :-2].view(BATCH, history, FRAME))
    output = head[1](functional.relu(head[0](torch.cat([features, data[:, -2:]], 1))))
    (output * numbers(output.numel(), 1.0, 3).view(output.shape)).sum().backward()
    flat = [(p.grad.permute(order) if order else p.grad).flatten() for p, order in slots]
    gradient = torch.cat(flat)
    print("case", name, count)
    print("output", *(repr(v) for v in output.flatten().tolist()))
    print("gradient", *(repr(v) for v in gradient[::29].tolist()))


for steps in (1, 4):
    run(f"TimeCnn{steps}", TimeCnn(steps), steps)
    run(f"BeamCnn{steps}", BeamCnn(steps), steps)
    run(f"Gru{steps}", Gru(steps), steps)
    run(f"Transformer{steps}", Transformer(steps), steps)
