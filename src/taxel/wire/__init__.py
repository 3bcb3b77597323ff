"""The wire format between a board and the host: frames, checks, messages.

One page of specification: `protocol/SPEC.md`; golden bytes: `protocol/vectors.json`.
"""
