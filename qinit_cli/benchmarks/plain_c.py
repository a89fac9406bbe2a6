"""The same loops as one writes them in C at the first go, compiled on the spot where there is a compiler."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
from pathlib import Path

FLAGS = ("-O3", "-march=native", "-shared", "-fPIC")

# Episodes start anywhere if `anywhere`, else in cell 0, or at rest at x = -0.5. Both give back the steps taken and change q.
SOURCE = r"""
#include <math.h>
#include <stdint.h>

static uint64_t rotate(uint64_t x, int by) { return (x << by) | (x >> (64 - by)); }

static uint64_t next(uint64_t *s) {
    uint64_t drawn = rotate(s[0] + s[3], 23) + s[0], t = s[1] << 17;
    s[2] ^= s[0]; s[3] ^= s[1]; s[1] ^= s[2]; s[0] ^= s[3]; s[2] ^= t; s[3] = rotate(s[3], 45);
    return drawn;
}

static double uniform(uint64_t *s) { return (next(s) >> 11) * 0x1.0p-53; }
static int below(uint64_t *s, int count) { return (int)(((next(s) >> 32) * count) >> 32); }

static double largest(const double *row, int actions) {
    double best = row[0];
    for (int a = 1; a < actions; a++) if (row[a] > best) best = row[a];
    return best;
}

static int choose(const double *row, int actions, double epsilon, uint64_t *s) {
    if (uniform(s) < epsilon) return below(s, actions);
    double best = largest(row, actions);
    int ties[4], count = 0;
    for (int a = 0; a < actions; a++) if (row[a] == best) ties[count++] = a;
    return count == 1 ? ties[0] : ties[below(s, count)];
}

long gridworld(uint64_t *s, double *q, int size, int goal, double p, int anywhere,
               double alpha, double gamma, double epsilon, long episodes, long horizon) {
    long steps = 0;
    for (long episode = 0; episode < episodes; episode++) {
        int cell = 0;
        if (anywhere) do cell = below(s, size * size); while (cell == goal);
        for (long time = 0; time < horizon && cell != goal; time++) {
            int action = choose(q + 4 * cell, 4, epsilon, s), move = action;
            if (uniform(s) >= p) move = (action + 1 + below(s, 3)) % 4;
            int row = cell / size, column = cell % size;
            if (move == 0 && row > 0) row--;
            if (move == 1 && row < size - 1) row++;
            if (move == 2 && column > 0) column--;
            if (move == 3 && column < size - 1) column++;
            int after = row * size + column;
            double target = after == goal ? 1.0 : gamma * largest(q + 4 * after, 4);
            q[4 * cell + action] += alpha * (target - q[4 * cell + action]);
            cell = after;
            steps++;
        }
    }
    return steps;
}

static int bin(double position, double velocity, int bins) {
    int row = (int)((position + 1.2) * bins / 1.8), column = (int)((velocity + 0.07) * bins / 0.14);
    return (row < bins ? row : bins - 1) * bins + (column < bins ? column : bins - 1);
}

long mountain_car(uint64_t *s, double *q, int bins, double eta, double hill, int anywhere,
                  double alpha, double gamma, double epsilon, long episodes, long horizon) {
    long steps = 0;
    for (long episode = 0; episode < episodes; episode++) {
        double position = -0.5, velocity = 0;
        if (anywhere) { position = -1.2 + 1.7 * uniform(s); velocity = -0.07 + 0.14 * uniform(s); }
        int state = bin(position, velocity, bins), done = 0;
        for (long time = 0; time < horizon && !done; time++) {
            int action = choose(q + 3 * state, 3, epsilon, s);
            double push = position >= hill ? eta : 0;
            velocity += (action - 1) * 0.001 - 0.0025 * cos(3 * position);
            velocity = fmin(fmax(velocity, -0.07), 0.07);
            position = fmin(fmax(position + velocity + push, -1.2), 0.6);
            if (position == -1.2 && velocity < 0) velocity = 0;
            int after = bin(position, velocity, bins);
            done = position >= 0.5 && velocity >= 0;
            double target = done ? 1.0 : gamma * largest(q + 3 * after, 3);
            q[3 * state + action] += alpha * (target - q[3 * state + action]);
            state = after;
            steps++;
        }
    }
    return steps;
}

/* tilings of (tiles + 1)^2 tiles, shifted by 1 and 3 parts of a tile (Sutton & Barto, 2018, section 9.5.4) */
static void activate(double position, double velocity, int tilings, int tiles, int *active) {
    double x = (position + 1.2) * tiles / 1.8, v = (velocity + 0.07) * tiles / 0.14;
    int along = tiles + 1;
    for (int i = 0; i < tilings; i++) {
        int row = (int)(x + (double)i / tilings), column = (int)(v + (double)(3 * i % tilings) / tilings);
        row = row < tiles ? row : tiles;
        column = column < tiles ? column : tiles;
        active[i] = 3 * ((i * along + row) * along + column);
    }
}

static void add_up(const double *w, const int *active, int tilings, double *values) {
    values[0] = values[1] = values[2] = 0;
    for (int i = 0; i < tilings; i++)
        for (int a = 0; a < 3; a++) values[a] += w[active[i] + a];
}

long tiled_car(uint64_t *s, double *w, int tilings, int tiles, double eta, int anywhere,
               double alpha, double gamma, double epsilon, long episodes, long horizon) {
    long steps = 0;
    int here[64], there[64]; /* the most tilings that there may be */
    double values[3];
    for (long episode = 0; episode < episodes; episode++) {
        double position = -0.5, velocity = 0;
        if (anywhere) { position = -1.2 + 1.7 * uniform(s); velocity = -0.07 + 0.14 * uniform(s); }
        int done = 0;
        activate(position, velocity, tilings, tiles, here);
        for (long time = 0; time < horizon && !done; time++) {
            add_up(w, here, tilings, values);
            int action = choose(values, 3, epsilon, s);
            double value = values[action], push = position >= 0 ? eta : 0;
            velocity += (action - 1) * 0.001 - 0.0025 * cos(3 * position);
            velocity = fmin(fmax(velocity, -0.07), 0.07);
            position = fmin(fmax(position + velocity + push, -1.2), 0.6);
            if (position == -1.2 && velocity < 0) velocity = 0;
            done = position >= 0.5 && velocity >= 0;
            activate(position, velocity, tilings, tiles, there);
            add_up(w, there, tilings, values);
            double step = alpha / tilings * ((done ? 1.0 : gamma * largest(values, 3)) - value);
            for (int i = 0; i < tilings; i++) w[here[i] + action] += step;
            for (int i = 0; i < tilings; i++) here[i] = there[i];
            steps++;
        }
    }
    return steps;
}
"""

_LEARNING = [ctypes.c_double, ctypes.c_double, ctypes.c_double, ctypes.c_long, ctypes.c_long]
_SIGNATURES = {
    "gridworld": [ctypes.c_int, ctypes.c_int, ctypes.c_double, ctypes.c_int, *_LEARNING],
    "mountain_car": [ctypes.c_int, ctypes.c_double, ctypes.c_double, ctypes.c_int, *_LEARNING],
    "tiled_car": [ctypes.c_int, ctypes.c_int, ctypes.c_double, ctypes.c_int, *_LEARNING],
}


def compiler() -> str | None:
    """The C compiler that there is: CC, else cc, gcc or clang; None if there is none."""
    named = os.environ.get("CC")
    return next(filter(None, map(shutil.which, [named] if named else ["cc", "gcc", "clang"])), None)


def library(compiler: str, folder: Path) -> ctypes.CDLL | None:
    """The compiled loops, built in `folder`, which must outlive them; None if the compiler fails."""
    source, built = folder / "plain.c", folder / "plain.so"
    source.write_text(SOURCE)
    command = [compiler, *FLAGS, str(source), "-o", str(built), "-lm"]
    if subprocess.run(command, capture_output=True).returncode != 0:
        return None
    loops = ctypes.CDLL(str(built))
    for name, arguments in _SIGNATURES.items():
        function = getattr(loops, name)
        function.restype = ctypes.c_long
        function.argtypes = [ctypes.c_void_p, ctypes.c_void_p, *arguments]
    return loops
