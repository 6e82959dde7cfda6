"""Files as instruments and programs write them: is each read right, to the row?

`python -m benchmarks.layouts [--real FOLDER]` writes small files in each layout that was met in
public data (`generated`), reads them with the commands' own door and holds every sample and time
against what was written (`judge`).
"""
