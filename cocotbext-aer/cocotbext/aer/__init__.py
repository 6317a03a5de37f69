"""Address Event Representation (AER) for cocotb: sources, sinks, monitors and protocol checkers.

``Aer...`` are of the four-phase bus, with one request or two; ``AerStream...`` of the clocked stream.
"""

from cocotbext.aer.base import Fault
from cocotbext.aer.bus import AerBus, AerStreamBus
from cocotbext.aer.checker import AerChecker, AerProtocolError, AerStreamChecker, Rule, Violation
from cocotbext.aer.event import AerEvent
from cocotbext.aer.four_phase import AerMonitor, AerSink, AerSource
from cocotbext.aer.funnel import AerFunnel
from cocotbext.aer.stream import AerStreamMonitor, AerStreamSink, AerStreamSource

__all__ = [
    "AerBus",
    "AerChecker",
    "AerEvent",
    "AerFunnel",
    "AerMonitor",
    "AerProtocolError",
    "AerSink",
    "AerSource",
    "AerStreamBus",
    "AerStreamChecker",
    "AerStreamMonitor",
    "AerStreamSink",
    "AerStreamSource",
    "Fault",
    "Rule",
    "Violation",
]
