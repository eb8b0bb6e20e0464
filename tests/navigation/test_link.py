"""The simulated serial line loses no more than it must: frames survive garbage, and corrupt ones do not pass."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxsub.errors import InputError
from jaxsub.navigation.link import ACCELEROMETER_RANGE, GYRO_RANGE, TICK, Decoder, Line, Reading, encode

GYRO_STEP, ACCELEROMETER_STEP = GYRO_RANGE / 32767, ACCELEROMETER_RANGE / 32767
SHORT, LONG = 23, 35

triples = lambda most: st.tuples(*[st.floats(-most, most)] * 3).map(np.array)
readings = st.builds(
    Reading,
    time=st.floats(0.0, 400_000.0),
    sequence=st.integers(0, 2**16 - 1),
    gyro=triples(GYRO_RANGE),
    accelerometer=triples(ACCELEROMETER_RANGE),
    fix=st.none() | triples(2e6),
)
# garbage is made of the bytes that could mislead, too
garbage = st.lists(st.binary(max_size=40) | st.sampled_from([b"\xa5", b"\x5a", b"\xa5\x5a\x00", b"\xa5\x5a\x01"])).map(
    b"".join
)


def a_reading(sequence=0, time=0.0, fix=None, rng=None):
    rng = rng or np.random.default_rng(sequence)
    return Reading(time, sequence, rng.uniform(-2, 2, 3), rng.uniform(-40, 40, 3), fix)


def frames(count, rate=20.0, fix_each=20):
    """As a sensor card sends them: a fix a second."""
    fix = np.array([10.0, -20.0, 3.0])
    ready = [k / rate for k in range(count)]
    return [(t, encode(a_reading(k, t, None if k % fix_each else fix))) for k, t in enumerate(ready)]


def bitwise_crc(body):
    """CRC-16 of the CCITT polynomial x¹⁶ + x¹² + x⁵ + 1, a bit at a time."""
    register = 0xFFFF
    for byte in body:
        for bit in range(7, -1, -1):
            high = (register >> 15) ^ (byte >> bit & 1)
            register = (register << 1 & 0xFFFF) ^ (0x1021 if high else 0)
    return register


@given(readings)
@settings(max_examples=200, deadline=None)
def test_a_reading_comes_back_to_half_a_unit(reading):
    frame = encode(reading)
    assert len(frame) == (SHORT if reading.fix is None else LONG)
    (found,) = Decoder().feed(frame)
    assert found.sequence == reading.sequence
    assert abs(found.time - reading.time) <= 0.5001 * TICK
    assert np.max(np.abs(found.gyro - reading.gyro)) <= 0.5001 * GYRO_STEP
    assert np.max(np.abs(found.accelerometer - reading.accelerometer)) <= 0.5001 * ACCELEROMETER_STEP
    assert (found.fix is None) == (reading.fix is None)
    if reading.fix is not None and found.fix is not None:
        assert np.max(np.abs(found.fix - reading.fix)) <= 0.5001e-3


def test_the_ranges_are_the_data_sheets_and_beyond_them_a_reading_saturates():
    np.testing.assert_allclose([math.degrees(GYRO_RANGE), ACCELEROMETER_RANGE / 9.80665], [150.0, 5.0])
    (found,) = Decoder().feed(encode(Reading(0.0, 0, np.array([9.0, -3.0, 2.6]), np.array([-49.0, 1e9, 49.1]))))
    np.testing.assert_allclose(found.gyro, [GYRO_RANGE, -GYRO_RANGE, 2.6], atol=GYRO_STEP)
    np.testing.assert_allclose(found.accelerometer, [-49.0, *[ACCELEROMETER_RANGE] * 2], atol=ACCELEROMETER_STEP)
    np.testing.assert_array_equal(found.saturated, [True, True, False, False, True, True])


def test_the_checksum_is_the_ccitts():
    frame = encode(a_reading(7, 1.5))
    assert int.from_bytes(frame[-2:], "little") == bitwise_crc(frame[2:-2])
    assert bitwise_crc(b"123456789") == 0x29B1


@pytest.mark.parametrize("time", [-1.0, 429_497.0, math.nan, math.inf])
def test_a_time_that_no_frame_holds_is_an_input_error(time):
    with pytest.raises(InputError, match="time"):
        encode(a_reading(time=time))


@pytest.mark.parametrize("where", ["gyro", "accelerometer", "fix"])
def test_a_number_that_is_not_finite_is_an_input_error(where):
    parts = {"gyro": np.zeros(3), "accelerometer": np.zeros(3), "fix": np.zeros(3)}
    parts[where][1] = np.nan
    with pytest.raises(InputError, match="nan"):
        encode(Reading(0.0, 0, **parts))


@given(st.lists(garbage, min_size=4, max_size=4), st.lists(readings, min_size=3, max_size=3), st.integers(1, 60))
@settings(max_examples=200, deadline=None)
def test_garbage_between_frames_costs_none_of_them(noise, sent, piece):
    """However the stream is cut into pieces. Bytes that look like a start delay a frame, so some are sent after."""
    stream = b"".join(g + encode(reading) for g, reading in zip(noise, sent, strict=False)) + noise[-1] + bytes(LONG)
    decoder = Decoder()
    found = [r for start in range(0, len(stream), piece) for r in decoder.feed(stream[start : start + piece])]
    assert [encode(reading) for reading in found] == [encode(reading) for reading in sent]
    assert decoder.good == 3


@given(st.integers(0, 2), st.integers(0, SHORT - 1), st.integers(1, 255))
@settings(max_examples=200, deadline=None)
def test_a_changed_or_lost_byte_costs_its_own_frame_only(which, at, change):
    sent = [encode(a_reading(k, 0.1 * k)) for k in range(4)]
    changed, short = bytearray(sent[which]), bytearray(sent[which])
    changed[at] ^= change
    del short[at]
    for damaged in (changed, short):
        decoder = Decoder()
        stream = b"".join(damaged if k == which else frame for k, frame in enumerate(sent)) + bytes(LONG)
        assert [reading.sequence for reading in decoder.feed(stream)] == [k for k in range(4) if k != which]
        assert decoder.missing == (which > 0)
        # without its sync word a frame is not seen at all
        assert decoder.bad >= (at >= 2)


def test_corrupt_frames_pass_no_more_often_than_the_checksum_lets_them():
    rng = np.random.default_rng(11)
    count = 300_000
    whole = np.frombuffer(encode(a_reading(3, 2.0)), np.uint8)
    stream = np.tile(whole, (count, 1))
    # everything but the sync word and the kind of frame
    stream[:, 3:] = rng.integers(0, 256, (count, SHORT - 3), np.uint8)
    decoder = Decoder()
    decoder.feed(stream.tobytes())
    expected = count / 2**16
    # a share 2⁻¹⁶ is a Poisson number of 4.6; a byte of checksum would let a thousand pass
    assert 0 < decoder.good < expected + 5.0 * np.sqrt(expected)
    assert decoder.good + decoder.bad >= count


def test_no_burst_of_sixteen_bits_passes():
    """What a CRC of 16 bits promises, for every place of two changed bytes in the frame."""
    rng = np.random.default_rng(12)
    whole = encode(a_reading(3, 2.0))
    for at in range(3, SHORT - 1):
        for first, second in rng.integers(0, 256, (200, 2)):
            damaged = bytearray(whole)
            damaged[at] ^= int(first)
            damaged[at + 1] ^= int(second)
            assert not Decoder().feed(bytes(damaged)) or damaged == whole


@given(st.lists(st.tuples(st.floats(0.0, 0.1), st.integers(1, 60)), min_size=1, max_size=40), st.integers(0, 2**32))
@settings(max_examples=100, deadline=None)
def test_the_line_never_exceeds_its_bit_rate(gaps, seed):
    ready, lengths = np.cumsum([gap for gap, _ in gaps]), [length for _, length in gaps]
    line = Line(np.random.default_rng(seed), jitter=0.02, corruption=0.1, dropout=0.1)
    arrived = list(line.carry((t, bytes(length)) for t, length in zip(ready, lengths, strict=True)))
    ends, sizes = np.array([t for t, _ in arrived]), np.array([len(data) for _, data in arrived])
    begins = ends - 10.0 * sizes / 9600.0
    # one frame at a time, so that of no stretch of time more is sent than its bits
    assert np.all(begins[1:] >= ends[:-1] - 1e-9)
    assert np.all(begins >= ready[0] - 1e-9)


def test_an_idle_line_delays_by_transmission_and_jitter_alone():
    sent = frames(400)
    quiet = np.array([t for t, _ in Line(np.random.default_rng(0)).carry(sent)])
    lengths = np.array([len(frame) for _, frame in sent])
    np.testing.assert_allclose(quiet - [t for t, _ in sent], lengths / 960.0, atol=1e-12)
    late = np.array([t for t, _ in Line(np.random.default_rng(0), jitter=0.01).carry(sent)]) - quiet
    assert late.min() >= 0.0 and late.max() <= 0.01
    assert late.mean() == pytest.approx(0.005, rel=0.1)


def test_too_many_frames_queue_up():
    """At 60 a second the line carries 41, and after ten seconds is some five behind."""
    sent = frames(600, rate=60.0, fix_each=601)
    arrived = [t for t, _ in Line(np.random.default_rng(0)).carry(sent)]
    assert arrived[-1] == pytest.approx((LONG + 599 * SHORT) / 960.0)


def test_dropouts_and_corruption_come_as_often_as_asked_and_are_counted():
    sent = frames(4000, rate=10.0, fix_each=10)
    line = Line(np.random.default_rng(4), corruption=0.002, dropout=0.05)
    decoder, arrived = Decoder(), list(line.carry(sent))
    assert len(arrived) == pytest.approx(0.95 * 4000, rel=0.01)
    found = [reading for _, data in arrived for reading in decoder.feed(data)]
    whole = [data for _, data in arrived if data in {frame for _, frame in sent}]
    bytes_each = 0.9 * SHORT + 0.1 * LONG
    assert len(whole) == pytest.approx(len(arrived) * 0.998**bytes_each, rel=0.01)
    assert [encode(reading) for reading in found] == whole
    # what is not missing between the first and the last was found
    assert decoder.good + decoder.missing == found[-1].sequence - found[0].sequence + 1
    assert 0 < decoder.bad < 2 * (len(arrived) - len(whole))


def test_the_same_seed_is_the_same_line():
    carried = lambda: list(Line(np.random.default_rng(9), jitter=0.01, corruption=0.01, dropout=0.1).carry(frames(50)))
    assert carried() == carried()
