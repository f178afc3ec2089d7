# Pictures as render makes them, bad series written down; what stands is not made again; names and folders from outside.
py batch.py "$ctsplat" "$data" "$PWD" plain resume journal zip outputs odd_names
# What is no volume passes; what is kept names no files; unreadable files; the sheet on the way; rotations.
py batch.py "$ctsplat" "$data" "$PWD" passed paths lost sheet told circles
