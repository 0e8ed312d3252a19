"""Notebooks run as a person runs them, by a kernel of their own."""

from __future__ import annotations

import asyncio
from pathlib import Path

import nbformat
from nbclient import NotebookClient


def run(notebook: nbformat.NotebookNode, folder: Path) -> None:
    """Run all cells in a folder. The event loop ends with the call."""
    client = NotebookClient(notebook, timeout=180, resources={"metadata": {"path": str(folder)}})
    asyncio.run(client.async_execute())
