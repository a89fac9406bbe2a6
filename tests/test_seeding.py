from __future__ import annotations

import itertools

import numpy as np

from qinit_cli.seeding import Stream, generator, sequence


def test_a_stream_is_numpys_own_seed_sequence_at_that_address() -> None:
    ours = sequence(7, Stream.TARGET_DICE, 12)
    spelled_out = np.random.SeedSequence(7, spawn_key=(4, 12))
    np.testing.assert_array_equal(ours.generate_state(32), spelled_out.generate_state(32))


def test_a_generator_is_numpys_pcg64_on_that_sequence() -> None:
    spelled_out = np.random.Generator(np.random.PCG64(np.random.SeedSequence(3, spawn_key=(0, 5))))
    np.testing.assert_array_equal(generator(3, Stream.SOURCE_TASK, 5).random(100), spelled_out.random(100))


def test_the_first_numbers_of_a_stream_never_change() -> None:
    frozen = [2635072618980576772, 8565498584995198975, 8661801837256207805]
    assert sequence(0, Stream.SOURCE_TASK, 0).generate_state(3, np.uint64).tolist() == frozen


def test_stream_numbers_never_change() -> None:
    # new ones come after; these are part of every result there is
    frozen = {
        "SOURCE_TASK": 0,
        "SOURCE_DICE": 1,
        "SOURCE_START": 2,
        "TARGET_TASK": 3,
        "TARGET_DICE": 4,
        "TARGET_START": 5,
        "TARGET_EVALUATION": 6,
        "TARGET_CHOICE": 7,
        "BOOTSTRAP": 8,
        "NORMALITY": 9,
        "HOLDOUT": 10,
        "SOURCE_WORLD": 11,
        "TARGET_WORLD": 12,
        "OPTIMAL_DICE": 13,
        "OPTIMAL_START": 14,
        "OPTIMAL_WORLD": 15,
    }
    assert frozen.items() <= {stream.name: int(stream) for stream in Stream}.items()
    assert len({int(stream) for stream in Stream}) == len(Stream.__members__)


def test_no_two_addresses_share_a_stream() -> None:
    addresses = list(itertools.product((0, 1, 2), Stream, range(20)))
    states = {tuple(sequence(*address).generate_state(4).tolist()) for address in addresses}
    assert len(states) == len(addresses)


def test_asking_for_one_index_does_not_move_another() -> None:
    alone = generator(1, Stream.SOURCE_TASK, 9).random(5)
    for index in range(9):
        generator(1, Stream.SOURCE_TASK, index).random(100)
    np.testing.assert_array_equal(generator(1, Stream.SOURCE_TASK, 9).random(5), alone)
