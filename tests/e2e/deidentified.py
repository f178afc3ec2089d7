"""The basic profile of PS3.15 (table E.1-1), attribute by attribute: deidentified.py fill FOLDER, or check FILE.

fill puts a unique marker into every attribute of the standard's dictionary that the reader does not need, which
includes all of the table; check finds none of them again. Attributes that the table keeps empty or replaces are
in `table`."""
import glob
import sys
import warnings

try:
    import pydicom
    from pydicom.datadict import DicomDictionary
except ImportError:
    sys.exit(77)

warnings.simplefilter('ignore')
pydicom.config.settings.reading_validation_mode = pydicom.config.settings.writing_validation_mode = 0
# Of what the table names, all that a secondary capture must hold: Z empty or a dummy, U another UID.
table = {0x00080018: 'U', 0x0020000D: 'U', 0x0020000E: 'U', 0x00080020: 'Z', 0x00080030: 'Z', 0x00080050: 'Z',
         0x00080090: 'Z', 0x00100030: 'Z', 0x00100040: 'Z', 0x00200010: 'Z', 0x00100010: 'D', 0x00100020: 'D'}
needed = {0x00080005, 0x00080008, 0x00080016, 0x00080018, 0x00080060, 0x00180015, 0x00200012, 0x00200013, 0x00200032,
          0x00200037, 0x00200060, 0x00200062, 0x00200100, 0x00181060, 0x00180060, 0x00280301}
text = 'ZQXMARK'
marks = {'DA': '19010203', 'TM': '010203.987654', 'DT': '19010203010203.987654', 'AS': '987Y', 'IS': '987654321',
         'DS': '987654.321', 'UI': '1.2.3.4.5.987654321', 'PN': 'ZQXMARK^Someone'}
texts = {'AE', 'CS', 'LO', 'LT', 'SH', 'ST', 'UC', 'UR', 'UT'}


def fill(folder):
    for path in glob.glob(folder + '/*.dcm'):
        d = pydicom.dcmread(path)
        for tag, (vr, *_) in DicomDictionary.items():
            group = tag >> 16
            if tag in needed or group in (0x0000, 0x0002, 0x0028, 0x5200, 0x7FE0, 0xFFFE, 0x0004) or group > 0x7000:
                continue
            if vr in marks or vr in texts:
                d.add_new(tag, vr, marks.get(vr, text))
            elif vr == 'SQ':
                item = pydicom.Dataset()
                item.PatientName, item.ReferencedSOPInstanceUID = marks['PN'], marks['UI']
                d.add_new(tag, 'SQ', [item])
        d.add_new(0x00091001, 'LO', text)
        d.add_new(0x00090010, 'LO', text)
        d.save_as(path)


def check(path, sources):
    raw, d = open(path, 'rb').read(), pydicom.dcmread(path)
    marked = pydicom.dcmread(sources + '/IM0001.dcm')
    assert len(marked) > 2000, len(marked)
    for mark in [text] + list(marks.values()) + ['987654']:
        assert mark.encode() not in raw, mark
    for source in glob.glob(sources + '/*.dcm'):
        assert pydicom.dcmread(source, specific_tags=['SOPInstanceUID']).SOPInstanceUID.encode() not in raw, source
    for tag, action in table.items():
        value = str(d[tag].value or '')
        if action == 'Z':
            assert value == '', (hex(tag), value)
        elif action == 'U':
            assert value.startswith('2.25.') and value != marked[tag].value, hex(tag)
        else:
            assert value.split('^')[-1].startswith('ANON-'), (hex(tag), value)
    assert d.PatientIdentityRemoved == 'YES' and d.DeidentificationMethodCodeSequence[0].CodeValue == '113100'
    assert not any(e.tag.is_private for e in d) and raw[:128] == bytes(128)


fill(sys.argv[2]) if sys.argv[1] == 'fill' else check(sys.argv[2], sys.argv[3])
