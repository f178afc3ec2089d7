#!/usr/bin/env python3
"""Every header of testdata/ against an independent reader: header_pydicom.py HEADER_DUMP SOURCE_ROOT

As the files are, and rewritten by pydicom with implicit VR and in big endian. Exit 77 where pydicom is missing."""
import glob
import os
import re
import subprocess
import sys
import tempfile
import warnings

try:
    import pydicom
except ImportError as missing:
    print(f'SKIP: {missing}')
    sys.exit(77)

DUMP, ROOT = sys.argv[1:3]
CT = '1.2.840.10008.5.1.4.1.1.2'
ENHANCED = (CT + '.1', CT + '.2')
TEXTS = ('SOPInstanceUID SeriesInstanceUID PatientID IssuerOfPatientID PatientName PatientBirthDate PatientSex '
         'StudyInstanceUID FrameOfReferenceUID Modality SeriesDescription SpecificCharacterSet StudyDate '
         'ConvolutionKernel').split()
WHOLE = 'SeriesNumber InstanceNumber AcquisitionNumber Rows Columns BitsAllocated BitsStored HighBit PixelRepresentation'
REAL = 'KVP TriggerTime SliceThickness RescaleSlope RescaleIntercept ImagePositionPatient PixelSpacing'
# A frame's attributes lie in its functional groups (PS3.3 C.7.6.16).
GROUPS = {'ImagePositionPatient': 'PlanePositionSequence', 'PixelSpacing': 'PixelMeasuresSequence',
          'SliceThickness': 'PixelMeasuresSequence', 'RescaleSlope': 'PixelValueTransformationSequence',
          'RescaleIntercept': 'PixelValueTransformationSequence', 'KVP': 'CTXRayDetailsSequence',
          'ConvolutionKernel': 'CTReconstructionSequence'}
OF_FRAMES = {'InstanceNumber', 'AcquisitionNumber'}  # frame content has others
warnings.simplefilter('ignore')
values = wrong = 0


def element(data, name, frame):
    """The element of a name, of a frame in its own or the shared groups; None: missing."""
    if not hasattr(data, 'PerFrameFunctionalGroupsSequence') or name not in GROUPS:
        return data.get_item(name)
    for group in (data.PerFrameFunctionalGroupsSequence[frame], *data.SharedFunctionalGroupsSequence[:1]):
        for item in group.get(GROUPS[name]) or []:
            if name in item:
                return item.get_item(name)
    return None


def raw(found):
    """A text's bytes, without padding, as header_dump prints them."""
    value = b'' if found is None or found.value is None else found.value
    if not isinstance(value, bytes):
        value = '\\'.join(value) if isinstance(value, (list, pydicom.multival.MultiValue)) else str(value)
        value = value.encode('latin-1', 'replace')
    value = value.rstrip(b' \0').lstrip(b' ')
    return ''.join(chr(c) if 0x20 <= c < 0x7F and c != 0x5C else f'\\x{c:02x}' for c in value)


def number(found, data, name):
    """Numbers of any VR, decoded by pydicom; None: none."""
    if found is None:
        return None
    if isinstance(found, pydicom.dataelem.RawDataElement):
        found = pydicom.dataelem.DataElement_from_raw(found, None)
    value = found.value
    if value is None or value == '':
        return None
    return [float(v) for v in (value if isinstance(value, (list, pydicom.multival.MultiValue)) else [value])]


def expect(same, path, name, ours, theirs):
    global values, wrong
    values += 1
    if not same:
        wrong += 1
        print(f'FAIL {path}: {name} is {ours!r} here and {theirs!r} in pydicom')


def compare(path, data, line):
    ours = dict(word.split('=', 1) for word in line.split('\t')[1:])
    frame = int(ours['frame'])
    frames = hasattr(data, 'PerFrameFunctionalGroupsSequence')
    for name in TEXTS:
        theirs = raw(element(data, name, frame))
        if name.startswith('Patient') or name.startswith('Issuer'):
            theirs = re.sub(r'[\^= ]*$', '', theirs)
        limit = 64 if name.endswith('UID') or name == 'ConvolutionKernel' else 16 if name == 'Modality' else None
        expect(ours[name] == theirs[:limit], path, name, ours[name], theirs)
    for name in (WHOLE + ' ' + REAL).split():
        if name not in ours or (frames and name in OF_FRAMES):
            continue
        try:
            theirs = number(element(data, name, frame), data, name)
        except (TypeError, ValueError):
            continue  # pydicom cannot read it either
        mine = [float(v) for v in ours[name].split()]
        absent = mine == [-1.0] and theirs is None
        expect(absent or mine == theirs, path, name, mine, theirs)
    pixels = data.get_item('PixelData')
    if 'PixelData' in ours and frame == 0 and pixels and not data.file_meta.TransferSyntaxUID.is_compressed:
        expect(int(ours['PixelData']) == pixels.value_tell, path, 'PixelData', ours['PixelData'], pixels.value_tell)


def read(path):
    """A CT slice as pydicom reads it, or None."""
    try:
        data = pydicom.dcmread(path)
    except Exception:
        return None
    return data if str(data.get('SOPClassUID', '')) in (CT, *ENHANCED) else None


def check(paths):
    """Compares files, whose headers are read in one run and in one message."""
    out = subprocess.run([DUMP, *paths], capture_output=True, text=True, check=True).stdout
    for line in out.splitlines():
        path = paths[int(line.split('\t', 1)[0])]
        data = read(path)
        if data is not None:
            compare(path, data, line)


files = [p for p in glob.glob(os.path.join(ROOT, 'testdata', '**'), recursive=True)
         if os.path.isfile(p) and os.path.getsize(p) > 132 and '/uid-control' not in p and '/fuzz/' not in p]
with tempfile.TemporaryDirectory() as folder:
    rewritten = []
    for path in files:
        data = read(path)
        if data is None:
            continue
        for k, (implicit, little) in enumerate(((True, True), (False, False))):
            try:
                data = read(path)
                data.is_implicit_VR, data.is_little_endian = implicit, little
                data.file_meta.TransferSyntaxUID = (pydicom.uid.ImplicitVRLittleEndian if implicit else
                                                    pydicom.uid.ExplicitVRBigEndian)
                data.pop('PixelData', None)
                for found in data.iterall():
                    found.value  # decodes it by its own syntax
                name = os.path.join(folder, f'{len(rewritten)}-{k}.dcm')
                data.save_as(name)
            except Exception:
                continue  # a damaged one
            rewritten.append(name)
    for some in (files, rewritten):
        for first in range(0, len(some), 500):
            check(some[first:first + 500])
print(f'{len(files)} + {len(rewritten)} files, {values} values, {wrong} of them wrong')
sys.exit(wrong > 0 or values < 10000)
