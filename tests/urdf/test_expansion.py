import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from closedchain.urdf import DescriptionError, expand, load_description

XACRO = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
LEGS = f"""<robot {XACRO} name="legs">
  <xacro:arg name="n" default="2"/>
  <xacro:arg name="length" default="${{0.25*2}}"/>
  <xacro:arg name="label" default="left"/>
  <xacro:property name="n" value="$(arg n)"/>
  <link name="base"/>
  <xacro:macro name="leg" params="i">
    <xacro:if value="${{i > 0}}">
      <link name="leg${{i}}"/>
      <joint name="j${{i}}" type="prismatic">
        <parent link="base"/><child link="leg${{i}}"/>
        <origin xyz="${{cos(pi*i)}} 0 $(arg length)"/>
        <limit lower="0" upper="1" effort="1" velocity="1"/>
      </joint>
      <xacro:leg i="${{i-1}}"/>
    </xacro:if>
  </xacro:macro>
  <xacro:leg i="${{n}}"/>
</robot>
"""


def robot(body: str, attributes: str = "") -> str:
    return f'<robot {XACRO} name="r" {attributes}><link name="a"/>{body}</robot>'


def refused(source, *words: str, parameters=None, **options) -> DescriptionError:
    with pytest.raises(DescriptionError) as caught:
        expand(source, parameters or {}, **options)
    for word in words:
        assert word in str(caught.value), str(caught.value)
    assert "\n" not in str(caught.value)
    assert caught.value.__suppress_context__ or caught.value.__context__ is None
    return caught.value


def test_text_without_xacro_is_kept():
    text = '<?xml version="1.0"?>\r\n<robot   name="r">\n<link name="a"/></robot>\n'
    assert expand(text).text == text
    assert dict(expand(text).parameters) == {}


def test_parameters_in_force():
    expansion = expand(LEGS, {"n": 3})
    assert dict(expansion.parameters) == {"n": 3, "length": 0.5, "label": "left"}
    assert "xacro" not in expansion.text.partition("<robot")[2]
    assert len(load_description(LEGS, {"n": 3}).joints) == 3
    assert load_description(LEGS).parameters["n"] == 2


def test_parameters_can_be_given_back():
    first = load_description(LEGS, {"length": 0.1 + 0.2})
    assert load_description(LEGS, first.parameters) == first
    assert first.joints[0].origin.xyz[2] == 0.1 + 0.2


@pytest.mark.parametrize(
    ("value", "text", "in_force"),
    [
        (4, "4", 4),
        (0.1, "0.1", 0.1),
        (-2e-300, "-2e-300", -2e-300),
        (np.float64(0.5), "0.5", 0.5),
        (np.int32(7), "7", 7),
        (np.bool_(True), "True", True),
        (True, "True", True),
        ("word", "word", "word"),
        ("1e3", "1e3", 1000.0),
        ("1e999", "1e999", "1e999"),
        ((1, 2.5, -3), "1 2.5 -3", "1 2.5 -3"),
        (np.array([1.0, 2.0]), "1.0 2.0", "1.0 2.0"),
    ],
)
def test_values(value, text, in_force):
    source = robot('<xacro:arg name="p" default=""/><gazebo v="$(arg p)"/>')
    expansion = expand(source, {"p": value})
    assert f'v="{text}"' in expansion.text
    assert expansion.parameters["p"] == in_force
    assert type(expansion.parameters["p"]) is type(in_force)


@pytest.mark.parametrize(
    "value",
    [float("nan"), float("inf"), [1, float("-inf")], None, 1j, {"a": 1}, b"x", ["1"], [[1], [2]]],
)
def test_values_that_have_no_text(value):
    refused(LEGS, "parameter 'length'", parameters={"length": value})


def test_unknown_parameter():
    refused(LEGS, "unknown parameter 'lenght'", "did you mean 'length'", "n, length, label",
            parameters={"lenght": 1})  # fmt: skip
    refused(LEGS, "unknown parameter 'closedchain'", parameters={"closedchain": "/tmp"})


def test_missing_parameter():
    source = robot('<xacro:arg name="size"/><gazebo v="$(arg size)"/>')
    refused(source, "parameter 'size' has no default")
    assert expand(source, {"size": 2}).parameters["size"] == 2


def test_an_argument_that_is_not_needed_may_be_missing():
    source = robot('<xacro:if value="false"><xacro:arg name="size"/></xacro:if>')
    assert dict(expand(source).parameters) == {}


def test_undeclared_and_early_arguments():
    refused(robot('<gazebo v="$(arg size)"/>'), "$(arg size)", "no <xacro:arg> declares it")
    refused(robot('<xacro:arg name="s" default="1"/>', 'version="$(arg s)"'), "$(arg s)", "before")


def test_parameters_without_xacro():
    refused('<robot name="r"/>', "parameters given (n)", parameters={"n": 1})


def test_xacro_switched_off():
    refused(LEGS, "<xacro:arg>", "xacro=False", xacro=False)
    error = refused('<robot name="r">\n<link name="${1}"/></robot>', "${1}", xacro=False)
    assert error.line == 2
    assert expand('<robot name="r"/>', xacro=False).text == '<robot name="r"/>'


def test_xacro_without_its_namespace():
    refused('<robot name="r"><xacro:if value="1"/></robot>', "does not declare xmlns:xacro")
    refused('<robot name="$(arg n)"/>', "does not declare xmlns:xacro")
    refused(robot("").replace("xmlns:xacro", "xmlns:x"), "must have the prefix xacro")


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ('<gazebo v="${1/0}"/>', ["division by zero", "1/0"]),
        ('<gazebo v="${missing}"/>', ["'missing' is not defined"]),
        ('<gazebo v="${1 +}"/>', ["1 +"]),
        ('<gazebo v="${"/>', ["${"]),
        ('<gazebo v="$(find nowhere)"/>', ["needs ROS"]),
        ('<gazebo v="$(env CLOSEDCHAIN_UNSET)"/>', ["CLOSEDCHAIN_UNSET"]),
        ('<gazebo v="${[][1]}"/>', ["list index"]),
        ('<gazebo v="${dict()[1]}"/>', ["1"]),
        ('<gazebo v="${__import__(1)}"/>', ["__import__"]),
        ('<xacro:nothing a="1"/>', ["unknown macro name", "xacro:nothing"]),
        ('<xacro:macro name="m" params="p"/><xacro:m/>', ["Undefined parameters [p]", "macro 'm'"]),
        ('<xacro:macro name="m" params=""/><xacro:m q="1"/>', ['Invalid parameter "q"']),
        ('<xacro:macro name="m"><xacro:m/></xacro:macro><xacro:m/>', ["nested too deeply"]),
        ('<xacro:property name="a" value="${b}"/><xacro:property name="b" value="${a}"/>${a}',
         ["circular"]),
        ('<xacro:if value="maybe"/>', ["maybe"]),
        ("<xacro:include/>", ["filename"]),
        ('<xacro:include filename="no/such.xacro"/>', ["no/such.xacro", "No such file"]),
        ('<xacro:include filename="no/such*.xacro"/>', ["no/such*.xacro", "matched no files"]),
        ('<xacro:arg name="a" defualt="1"/>', ["unknown attribute", "defualt"]),
        ("<xacro:arg default='1'/>", ["name"]),
        ('<xacro:property name="y" value="${load_yaml(\'no.yaml\')}"/>${y}', ["no.yaml"]),
    ],
)  # fmt: skip
def test_xacro_failures(body, words, capfd):
    refused(robot(body), *words)
    assert expand(LEGS).parameters["n"] == 2  # the failure left nothing behind
    assert capfd.readouterr() == ("", "")


def test_chatter_does_not_leak(capfd):
    expand(robot("${xacro.warning('careful')}<gazebo v='${range(2)}' w='${xacro.message(1)}'/>"))
    assert capfd.readouterr() == ("", "")


def test_bad_yaml(tmp_path):
    (tmp_path / "bad.yaml").write_text("a: [1, 2")
    file = tmp_path / "r.xacro"
    file.write_text(robot("<gazebo v=\"${xacro.load_yaml('bad.yaml').a}\"/>"))
    refused(file, "load_yaml")
    (tmp_path / "bad.yaml").write_text("a: 3")
    assert 'v="3"' in expand(file).text


BOMB = """<!DOCTYPE robot [
  <!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;">
]>
<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="r">&c;</robot>
"""


EXTERNAL = '<!DOCTYPE robot SYSTEM "file:///etc/passwd"><robot name="r"/>'


@pytest.mark.parametrize("text", [BOMB, BOMB.replace("xmlns:xacro", "xmlns:x"), EXTERNAL])
def test_doctype_is_refused(text):
    assert refused("\n" + text, "DOCTYPE").line == 2
    refused(text, "DOCTYPE", xacro=False)


def test_doctype_in_an_included_file_is_refused(tmp_path):
    (tmp_path / "bomb.xacro").write_text(BOMB)
    file = tmp_path / "r.xacro"
    file.write_text(robot('<xacro:include filename="bomb.xacro"/>'))
    refused(file, "DOCTYPE", "bomb.xacro")
    file.write_text(robot("<xacro:include filename=\"${'bomb'}.xacro\"/>"))
    refused(file, "DOCTYPE", "bomb.xacro")


def test_malformed_included_file(tmp_path):
    (tmp_path / "bad.xacro").write_text("<robot>\n<link>\n</robot>")
    file = tmp_path / "r.xacro"
    file.write_text(robot('<xacro:include filename="bad.xacro"/>'))
    assert refused(file, "mismatched tag", "bad.xacro").line == 3


def test_recursive_includes(tmp_path):
    one, two = tmp_path / "one.xacro", tmp_path / "two.xacro"
    one.write_text(robot('<xacro:include filename="two.xacro"/>'))
    two.write_text(robot('<xacro:include filename="./one.xacro"/>'))
    refused(one, "includes itself", "one.xacro -> ", "two.xacro -> ")
    two.write_text(robot('<xacro:include filename="two.xacro"/>'))
    refused(two, "includes itself")
    refused(one, "includes itself", "one.xacro -> ")


def test_the_same_file_may_be_included_twice(tmp_path):
    (tmp_path / "part.xacro").write_text(robot("").replace('<link name="a"/>', "<gazebo/>"))
    file = tmp_path / "r.xacro"
    file.write_text(robot('<xacro:include filename="part.xacro"/>' * 2))
    assert expand(file).text.count("<gazebo/>") == 2


def test_optional_include():
    assert expand(robot('<xacro:include filename="no.xacro" optional="true"/>')).text


def test_arguments_of_included_files(tmp_path, monkeypatch):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "part.xacro").write_text(
        robot('<xacro:arg name="deep" default="5"/><gazebo v="$(arg deep)"/>')
    )
    file = tmp_path / "r.xacro"
    file.write_text(robot('<xacro:include filename="sub/part.xacro"/>'))
    assert 'v="6"' in expand(file, {"deep": 6}).text
    refused(file, "unknown parameter 'depe'", "deep", parameters={"depe": 1})
    file.write_text(robot("<xacro:include filename=\"${'sub'}/part.xacro\"/>"))
    assert expand(str(file), {"deep": 6}).parameters["deep"] == 6
    refused(file, "unknown parameter 'depe'", "deep", parameters={"depe": 1})
    monkeypatch.chdir(tmp_path)
    assert expand(file.read_text()).parameters["deep"] == 5
    monkeypatch.chdir("/")
    assert expand(file).parameters["deep"] == 5


def test_the_folder_of_macros_is_an_argument():
    expansion = expand(robot('<gazebo v="$(arg closedchain)"/>'))
    folder = expansion.text.partition('v="')[2].partition('"')[0]
    assert os.path.isabs(folder)
    assert Path(folder).parts[-2:] == ("urdf", "macros")
    assert dict(expansion.parameters) == {}


@pytest.mark.parametrize("content", [b"", b" \n", b"\xff\xfe<\x00", b"\x89PNG\r\n\xff", b"<robot/"])
def test_files_that_are_no_xml(tmp_path, content):
    file = tmp_path / "bad file.urdf"
    file.write_bytes(content)
    refused(file, "bad file.urdf")


@pytest.mark.parametrize("source", ["", "  ", "no/such/file.urdf", "a\x00b", "x" * 5000, "."])
def test_sources_that_are_no_file(source):
    refused(source)


def test_a_byte_order_mark_is_harmless(tmp_path):
    file = tmp_path / "r.urdf"
    file.write_bytes(b'\xef\xbb\xbf<robot name="r"/>')
    assert expand(file).text == '<robot name="r"/>'
    assert expand('\ufeff<robot name="r"/>').text == '<robot name="r"/>'


def test_a_character_that_xml_does_not_allow():
    assert refused('<robot name="r">\n\ud800</robot>', "not allowed").line == 2


def test_threads():
    counts = [1, 2, 3, 4] * 6
    with ThreadPoolExecutor(4) as pool:
        texts = list(pool.map(lambda n: expand(LEGS, {"n": n}).text, counts))
    assert [text.count("<joint ") for text in texts] == counts


def test_threads_with_failures_among_them():
    def one(n: int) -> str:
        source = LEGS if n % 2 else LEGS.replace('name="leg"', 'name="gel"')
        try:
            return str(expand(source, {"n": n}).text.count("<joint "))
        except DescriptionError as error:
            return str(error)

    with ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(one, range(1, 25)))
    assert answers[::2] == [str(n) for n in range(1, 25, 2)]
    assert all("unknown macro" in answer for answer in answers[1::2])


def test_importing_the_reader_does_not_load_xacro():
    code = "import sys, closedchain.urdf; sys.exit('xacro' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
