# Pictures as render makes them, bad series written down; what stands is not made again; names and folders from outside.
py batch.py "$ctsplat" "$data" "$PWD" plain resume journal zip outputs odd_names
