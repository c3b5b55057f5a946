"""A gait's commands as numbers that compiled code can follow."""

import math
from typing import Any, NamedTuple

import numpy as np

from snakebench.compilation import njit
from snakebench.value import FloatArray


class Waveform(NamedTuple):
    """A gait's commands as numbers for compiled code: three kinds of table, one value per joint in each row."""

    kind: int  # HARMONICS, SAMPLES or HELD
    rate: float  # base frequency, or rows per second [Hz]
    table: FloatArray  # cosine and sine amplitudes in turn, one period's samples, or held values; (rows, n_joints)
    bound: float  # on the absolute value of a command


HARMONICS, SAMPLES, HELD = 0, 1, 2


@njit(error_model="numpy")
def command_at(
    kind: int, rate: float, table: FloatArray, rows: int, bound: float, time: float, command: FloatArray
) -> None:
    """Write the command of every joint at a time [s] into `command`; the first `rows` of the table count."""
    command[:] = 0.0
    if kind == HARMONICS:
        for h in range(rows // 2):
            angle = 2 * np.pi * rate * (h + 1) * time
            cos, sin = math.cos(angle), math.sin(angle)
            for j in range(len(command)):
                command[j] += table[2 * h, j] * cos + table[2 * h + 1, j] * sin
    elif kind == SAMPLES:
        place = time * rate
        before = np.floor(place)
        row, share = int(before) % rows, place - before
        for j in range(len(command)):
            command[j] = (1 - share) * table[row, j] + share * table[(row + 1) % rows, j]
    else:
        command[:] = table[min(int(time * rate + 1e-9), rows - 1)]  # a time that meets a row's start is in that row
    for j in range(len(command)):
        command[j] = min(max(command[j], -bound), bound)


@njit(cache=True)
def commands_at(waveform: Any, times: FloatArray) -> FloatArray:
    """The commands of a `Waveform` at times [s], shape (n_times, n_joints)."""
    kind, rate, table, bound = waveform
    commands = np.empty((len(times), table.shape[1]))
    for k in range(len(times)):
        command_at(kind, rate, table, len(table), bound, times[k], commands[k])
    return commands
