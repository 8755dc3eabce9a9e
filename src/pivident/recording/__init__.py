"""Recordings: what was measured, read from files, checked, in SI units on the joint side."""

from pivident.recording.load import load_recording as load_recording
from pivident.recording.load import recording_from as recording_from
from pivident.recording.recording import Recording as Recording
