"""The sandbox: untrusted code in namespaces of its own (bubblewrap), bounded and filtered.

What it promises, and what not, is in ``docs/sandbox.md``.
"""
