"""Connection of a simulated board's serial line, bit by bit, to a pseudo-terminal for the host program."""

import os
import select
import signal
import subprocess
import time
import tty
from collections.abc import Callable
from typing import Any

import cocotb
from cocotb.triggers import FallingEdge, RisingEdge, Timer

CLOCK_NS = 20
IDLE_BITS = 20
"""Bit times to simulate while the host sends nothing."""

NAP_S = 0.0005
"""Pause that gives a host on the same core time to run, unless the host sends a byte earlier."""
LOADING_NAP_S = 0.005
"""Pause while the host loads its libraries, before its first byte."""

MAX_SECONDS = 120
BEGINS_AFTER = 27
"""Bytes that a host sends before it listens: HELLO, RESTART and the first STATUS."""

Spoil = Callable[[int, int], int | None]
"""Function of the number of a byte on the line and the byte; returns the disturbed byte, or None for a lost byte."""


def as_it_is(number: int, byte: int) -> int | None:
    """Return a byte unchanged."""
    return byte


class Line:
    """Converter between bytes at a pseudo-terminal and the pins ``rx`` and ``tx`` of a board.

    ``to_board`` and ``to_host`` change the bytes on the line.
    """

    def __init__(self, dut: Any, baud: int, to_board: Spoil = as_it_is, to_host: Spoil = as_it_is) -> None:
        self.dut, self.bit_ps = dut, round(1e12 / baud)
        self.to_board, self.to_host = to_board, to_host
        self.master, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(self.master, False)
        self.port = os.ttyname(slave)
        self._slave = slave  # kept open: a terminal without an owner disappears
        self.sent = self.received = 0

    async def run(
        self, host: subprocess.Popen[str], pull_after: int | None = None, sender: Any = None, wait_bits: int = 0
    ) -> None:
        """Transfer bytes until the host program ends.

        The cable is unplugged after ``pull_after`` bytes from the board. The coroutine ``sender`` begins when the host
        has begun to record; the host gets a Ctrl-C ``wait_bits`` bit times after its end.
        """
        listening = cocotb.start_soon(self._from_board())
        sending, begun = None, time.monotonic()
        while host.poll() is None and time.monotonic() - begun < MAX_SECONDS:
            if pull_after is not None and self.received >= pull_after:
                os.close(self._slave)
                os.close(self.master)
                break
            if sender is not None and sending is None and self.sent >= BEGINS_AFTER:
                sending = cocotb.start_soon(sender)
            if sending is not None and sending.done():
                sending = sender = None
                cocotb.start_soon(self._interrupt(host, wait_bits))
            try:
                data = os.read(self.master, 256)
            except BlockingIOError:
                data = b""
            if not data:
                select.select([self.master], [], [], NAP_S if self.sent else LOADING_NAP_S)
                await Timer(IDLE_BITS * self.bit_ps, "ps")
            for byte in data:
                if (sent := self.to_board(self.sent, byte)) is not None:
                    await self._send(sent)
                self.sent += 1
        listening.cancel()
        if sending is not None:  # the host ended before the sender
            sending.cancel()

    async def _interrupt(self, host: subprocess.Popen[str], wait_bits: int) -> None:
        await Timer(wait_bits * self.bit_ps, "ps")
        host.send_signal(signal.SIGINT)

    async def _send(self, byte: int) -> None:
        bits = [0, *(byte >> n & 1 for n in range(8)), 1]
        while bits:
            run = next((n for n, bit in enumerate(bits) if bit != bits[0]), len(bits))
            self.dut.rx.value = bits[0]
            await Timer(run * self.bit_ps, "ps")
            bits = bits[run:]

    async def _from_board(self) -> None:
        tx = self.dut.tx
        while True:
            await FallingEdge(tx)
            await Timer(self.bit_ps * 3 // 2, "ps")
            byte = 0
            for n in range(8):
                byte |= int(tx.value) << n
                await Timer(self.bit_ps, "ps")
            if not int(tx.value):  # sampling began in the middle of a byte
                await RisingEdge(tx)
                continue
            if (sent := self.to_host(self.received, byte)) is not None:
                os.write(self.master, bytes([sent]))
            self.received += 1
