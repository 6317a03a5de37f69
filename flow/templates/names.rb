
# Names of nets are the texts of the top cell alone: those inside the cells are the names of their pins.
def names(number)
    texts = RBA::Texts::new
    index = source.layout.find_layer(number, 0)
    source.cell_obj.shapes(index).each { |shape| texts.insert(shape.text) if shape.is_text? } if index
    DRC::DRCLayer::new(self, texts)
end
connect(li, names(67))
connect(m1, names(68))
connect(m2, names(69))
connect(m3, names(70))
# There is no power mesh: the rails of the rows are one net by their name.
connect_implicit("vdd")
connect_implicit("vss")
